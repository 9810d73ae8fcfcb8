#!/usr/bin/env python3
"""
Match the lines of two synchronised cameras: an example of ~/planes and ~/arcs of two detectors.

python3 stereo_matcher.py --ros-args -p 'right_in_left:=[0.12, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]'

Subscribes to ``left/planes``, ``left/arcs``, ``right/planes`` and ``right/arcs``, of one detector
for each camera, and pairs them by equal stamps.  The parameter ``right_in_left`` is the pose of
the right optical frame in the left one: position (m) and quaternion x y z w.  Publishes
``~/lines``, a PointCloud2 with a record for each match whose line is determined (doc/mapping.md):
start, end and covariance in the left optical frame, the track of the left line, and that of the
right one as ``right_track``.
"""
from __future__ import annotations

from typing import Any

import numpy as np
from numpy.lib import recfunctions
from qflsd_ros.core.geometry.line_map import MappedLines
from qflsd_ros.core.geometry.stereo import match, Sight
from qflsd_ros.core.pose import Pose
from qflsd_ros.records import of_lines, planes_of
from qflsd_ros.ros.output.clouds import cloud, records
import rclpy
from rclpy.exceptions import InvalidParameterValueException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import PointCloud2

TOPICS = 'left/planes', 'left/arcs', 'right/planes', 'right/arcs'
WAITING = 30        # stamps whose messages are kept until all four have come: a second at 30 Hz
LOG_PERIOD = 5.0    # s between two warnings


def sight(planes: PointCloud2, arcs: PointCloud2) -> tuple[np.ndarray, Sight]:
    """Return the tracks and the lines that one camera sees."""
    tracks, found = planes_of(records(planes))
    return tracks, Sight(found, records(arcs)['contrast'][found.arcs].astype(float))


class StereoMatcher(Node):
    """Matches the lines of two detectors."""

    def __init__(self) -> None:
        super().__init__('stereo_matcher')
        mount = self.declare_parameter('right_in_left', [0.12, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]).value
        if len(mount) != 7 or not np.any(mount[:3]):
            raise InvalidParameterValueException(
                'right_in_left', mount, 'must be x y z, not all 0, and the quaternion x y z w')
        self._pose = Pose.from_quaternion(np.array(mount[3:]), np.array(mount[:3]))
        self._waiting: dict[tuple[int, int], dict[str, PointCloud2]] = {}
        self._lost = 0
        for topic in TOPICS:
            self.create_subscription(
                PointCloud2, topic, lambda message, topic=topic: self._take(topic, message),
                QoSProfile(depth=20))
        self._lines = self.create_publisher(PointCloud2, '~/lines', QoSProfile(depth=5))

    def _take(self, topic: str, message: PointCloud2) -> None:
        """Keep a message until those of the same stamp have come."""
        stamp = message.header.stamp.sec, message.header.stamp.nanosec
        found = self._waiting.setdefault(stamp, {})
        found[topic] = message
        if len(found) == len(TOPICS):
            del self._waiting[stamp]
            self._publish(*(found[name] for name in TOPICS))
        elif len(self._waiting) > WAITING:
            del self._waiting[next(iter(self._waiting))]
            self._lose('a message of the same stamp is missing: are the cameras synchronised?')

    def _publish(self, *messages: Any) -> None:
        try:
            tracks, left = sight(*messages[:2])
            others, right = sight(*messages[2:])
            found = match(left, right, self._pose)
        except (ValueError, KeyError, IndexError, TypeError, np.linalg.LinAlgError) as error:
            self._lose(f'they are not those of a detector: {error}')
            return
        good = found.lines.determined
        rows = of_lines(MappedLines(tracks[found.left[good]], np.full(good.sum(), 2),
                                    found.lines.chosen(good)))
        rows = recfunctions.append_fields(
            rows, 'right_track', others[found.right[good]].astype('<u4'), usemask=False)
        self._lines.publish(cloud(messages[0].header, rows))

    def _lose(self, reason: str) -> None:
        self._lost += 1
        self.get_logger().warning(f'{self._lost} pairs of images not matched; the last one: '
                                  f'{reason}', throttle_duration_sec=LOG_PERIOD)


def main() -> None:
    """Run until SIGINT (Ctrl-C)."""
    try:
        rclpy.init()
        rclpy.spin(StereoMatcher())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
