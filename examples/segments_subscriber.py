#!/usr/bin/env python3
"""
Log the longest segment of every frame: an example of reading ~/segments with numpy.

python3 segments_subscriber.py --ros-args -r segments:=/detector/segments
"""
from __future__ import annotations

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2


def polylines(message: PointCloud2) -> list[np.ndarray]:
    """Return the points of each segment, x and y in px: a list of (K, 2) float32 arrays."""
    # By the offsets in the message: fields that a later version adds change nothing here.
    offsets = {field.name: field.offset for field in message.fields}
    points = np.frombuffer(bytes(message.data), np.dtype({
        'names': ['x', 'y', 'segment'], 'formats': ['<f4', '<f4', '<u4'],
        'offsets': [offsets['x'], offsets['y'], offsets['segment']],
        'itemsize': message.point_step}))
    first = np.flatnonzero(np.diff(points['segment'])) + 1
    xy = np.stack([points['x'], points['y']], axis=1)
    return np.split(xy, first) if len(xy) else []


def length(polyline: np.ndarray) -> float:
    """Return the length of a polyline in px."""
    return float(np.linalg.norm(np.diff(polyline, axis=0), axis=1).sum())


class SegmentsSubscriber(Node):
    """Subscribes to the segments of the detector."""

    def __init__(self) -> None:
        super().__init__('segments_subscriber')
        self.create_subscription(PointCloud2, 'segments', self.receive, 10)

    def receive(self, message: PointCloud2) -> None:
        """Log the number of segments in a message, and the longest of them."""
        segments = polylines(message)
        text = f'{len(segments)} segments'
        if segments:
            longest = max(segments, key=length)
            (x0, y0), (x1, y1) = longest[0], longest[-1]
            text += (f', the longest from ({x0:.1f}, {y0:.1f}) to ({x1:.1f}, {y1:.1f}): '
                     f'{length(longest):.1f} px')
        self.get_logger().info(text)


def main() -> None:
    """Run until SIGINT (Ctrl-C)."""
    try:
        rclpy.init()
        rclpy.spin(SegmentsSubscriber())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
