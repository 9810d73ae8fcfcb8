"""A detector process between a camera and a subscriber, both of the test."""
from __future__ import annotations

from array import array
from collections import defaultdict
import itertools
from typing import Any, TYPE_CHECKING

import cv2
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Vector3Stamped
import numpy as np
from qflsd_ros.core import Detector
from qflsd_ros.ros.output import clouds
from qflsd_ros.ros.parameters.node_parameters import Settings
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, Imu, PointCloud, PointCloud2
from visualization_msgs.msg import MarkerArray

if TYPE_CHECKING:
    from conftest import Peer, Process

NODE = ('-m', 'qflsd_ros.ros', 'detector', '--ros-args')
TYPES = {'segments': PointCloud2, 'arcs': PointCloud2, 'markers': MarkerArray, 'overlay': Image,
         'planes': PointCloud2, 'line_features': PointCloud, 'camera_info': CameraInfo,
         'rectified': PointCloud2, 'attitude': Imu, 'gravity': Vector3Stamped}
COUNTS = ('frames', 'frames lost', 'frames dropped', 'frames bad')
stamps = itertools.count(1000)


def scene() -> np.ndarray:
    """Return a grey frame with straight and circular edges."""
    gray = np.full((240, 320), 60, np.uint8)
    cv2.rectangle(gray, (30, 40), (150, 200), 180, -1)
    cv2.circle(gray, (340, 120), 140, 220, -1)
    return gray


SCENE = scene()
BLACK = np.zeros_like(SCENE)
EXPECTED = Detector().detect(SCENE).polylines(Settings().polyline_tolerance)


def image(pixels: np.ndarray, encoding: str = 'mono8', **changes: Any) -> Image:
    """Return a message with a unique stamp."""
    message = Image(encoding=encoding, height=pixels.shape[0], width=pixels.shape[1],
                    step=pixels.strides[0], data=array('B', pixels.tobytes()))
    message.header.frame_id = 'camera_optical'
    message.header.stamp.sec = next(stamps)
    for name, value in changes.items():
        setattr(message, name, value)
    return message


class Rig:
    """
    A detector process between a camera and a subscriber, both of the test.

    Lens and tracking are off by default: a test may publish the same frame several times, and
    compares the result with that of a detector.
    """

    def __init__(self, peer: Peer, *arguments: str, node: str = '/detector',
                 topic: str = '/image', camera_type: type = Image,
                 listen: tuple[str, ...] = ('segments',), lens: str = 'off',
                 tracking: bool = False,
                 camera_qos: QoSProfile = qos_profile_sensor_data, **environment: str) -> None:
        self.peer, self.name, self.topic = peer, node, topic
        self.received: dict[str, list[Any]] = defaultdict(list)
        self.camera = peer.node.create_publisher(camera_type, topic, camera_qos)
        self.subscriptions = {output: self.listen(output) for output in listen}
        self.reports: list[DiagnosticStatus] = []
        self.published = 0
        peer.node.create_subscription(
            DiagnosticArray, '/diagnostics',
            lambda message: self.reports.extend(message.status), 10)
        self.process: Process = peer.run(
            *NODE, *arguments, '-p', f'lens:={lens}', '-p', f'tracking:={str(tracking).lower()}',
            **environment)

    def listen(self, output: str) -> Any:
        return self.peer.node.create_subscription(
            TYPES[output], f'{self.name}/{output}', self.received[output].append, 10)

    def ready(self) -> Rig:
        """
        Return when the detector subscribes to the camera, and is connected to every listener.

        Each end of a connection learns of the other by itself: a result that comes before a
        subscription knows its publisher is not received.
        """
        self.peer.until(lambda: self.camera.get_subscription_count() and all(
            subscription.get_publisher_count() for subscription in self.subscriptions.values()))
        return self

    def detect(self, message: Image | CompressedImage, output: str = 'segments') -> Any:
        """Publish a frame until its result arrives; return the result."""
        def result() -> Any:
            return next((answer for answer in self.received[output]
                         if header(answer) == message.header), None)
        return self.peer.until(result, lambda: self.publish(message))

    def publish(self, message: Image | CompressedImage) -> None:
        """Publish a frame once, and count it."""
        self.camera.publish(message)
        self.published += 1

    def total(self) -> int:
        """Return the number of frames, of any fate, in the newest diagnostics."""
        counts = values(self.reports[-1]) if self.reports else {}
        return sum(int(counts.get(key, 0)) for key in COUNTS)

    def settle(self) -> None:
        """Return when diagnostics account for all frames published so far."""
        self.detect(image(SCENE))
        self.reports.clear()
        before = -1

        def stable() -> bool:
            nonlocal before
            if len(self.reports) < 2:
                return False
            before, total = self.total(), before
            self.reports.clear()
            return before == total
        self.peer.until(stable)
        self._begin = self.published - before

    def accounted(self) -> bool:
        """Return whether diagnostics count each frame since :meth:`settle` exactly once."""
        assert self.total() <= self.published - self._begin
        return self.total() == self.published - self._begin

    def show(self, message: Image | CompressedImage, text: str) -> None:
        """Publish a frame until the log of the detector contains a text."""
        self.peer.until(lambda: text in self.process.output,
                        lambda: self.camera.publish(message))

    def report(self, *texts: str) -> DiagnosticStatus:
        """Return the next diagnostics that contain all of the texts."""
        self.reports.clear()
        return self.peer.until(lambda: next(
            (status for status in self.reports
             if all(text in f'{status.message} {values(status)}' for text in texts)), None))

    def change(self, **changes: Any) -> list[Any]:
        """Set parameters through the node's service; return the results."""
        return self.peer.call(SetParameters, f'{self.name}/set_parameters', parameters=[
            RosParameter(name, value=value).to_parameter_msg()
            for name, value in changes.items()]).results


def header(message: Any) -> Any:
    return message.markers[0].header if isinstance(message, MarkerArray) else message.header


def values(status: DiagnosticStatus) -> dict[str, str]:
    return {item.key: item.value for item in status.values}


def same(message: PointCloud2, expected: list[np.ndarray], within: float = 1e-3) -> bool:
    """Return whether a message contains exactly these polylines."""
    found = clouds.polylines(message)
    return len(found) == len(expected) and all(
        one.shape == other.shape and np.abs(one - other).max() < within
        for one, other in zip(found, expected))
