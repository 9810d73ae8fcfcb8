"""
A camera and a listener on another host than the detector's, and a cut of the cable between them.

Prints a JSON line for each stage: results that came in it, frames sent so far, the first and the
newest of these that had a result, and the counts of the newest diagnostics.
"""
from __future__ import annotations

from array import array
import json
from pathlib import Path
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import rclpy
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image, PointCloud2

CUT = 10.0      # s
PATIENCE = 60.0
RATE = 20.0     # Hz


class FarCamera:
    """Publishes small frames, numbered by their stamps, and counts results."""

    def __init__(self) -> None:
        rclpy.init()
        self.node = rclpy.create_node('far_camera')
        self.camera = self.node.create_publisher(Image, 'image', qos_profile_sensor_data)
        self.results: list[int] = []
        self.counts: dict[str, str] = {}
        self.node.create_subscription(PointCloud2, '/detector/segments', self._result, 10)
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._report, 10)
        pixels = np.full((60, 80), 30, np.uint8)
        pixels[15:45, 20:60] = 200
        self.image = Image(height=60, width=80, step=80, encoding='mono8',
                           data=array('B', pixels.tobytes()))
        self.sent = 0

    def _result(self, message: PointCloud2) -> None:
        assert message.width >= 8  # the four sides
        self.results.append(message.header.stamp.sec)

    def _report(self, message: DiagnosticArray) -> None:
        self.counts = {item.key: item.value for item in message.status[0].values}

    def play(self, seconds: float, enough: int = sys.maxsize) -> None:
        """Publish frames for a while, or until enough new results have come; say how it went."""
        begin, end = len(self.results), time.monotonic() + seconds
        while time.monotonic() < end and len(self.results) - begin < enough:
            self.sent += 1
            self.image.header.stamp.sec = self.sent
            self.camera.publish(self.image)
            pause = time.monotonic() + 1 / RATE
            while (left := pause - time.monotonic()) > 0:
                rclpy.spin_once(self.node, timeout_sec=left)
        print(json.dumps({'results': len(self.results) - begin, 'sent': self.sent,
                          'first': min(self.results, default=0),
                          'newest': max(self.results, default=0), 'counts': self.counts}),
              flush=True)


def main() -> None:
    camera = FarCamera()
    camera.play(PATIENCE, enough=20)
    Path('cut').touch()
    camera.play(1.0)  # what was on its way
    camera.play(CUT)
    Path('cut').unlink()
    camera.play(PATIENCE, enough=60)
    camera.play(3.0)


if __name__ == '__main__':
    main()
