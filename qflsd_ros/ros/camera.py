"""
The ``camera`` node: images from the synthetic scene, files, a video, a webcam or a rosbag2.

It publishes reliably, which subscriptions of either kind match, as REP 2003 has it for drivers.
A slow subscription never holds it up: it keeps the last few images for repetition and no more.
"""
from __future__ import annotations

from array import array
from collections.abc import Iterator
from dataclasses import dataclass
import itertools
import time
from typing import Callable

from builtin_interfaces.msg import Time
from qflsd_ros.core.parameters import check, parameter
from qflsd_ros.ros.kernels import Kernels
from qflsd_ros.ros.parameters import declaration
from qflsd_ros.ros.run import run
from qflsd_ros.sources import Frame, open_source, Scene, SceneFrames, Source
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Image

SYNTHETIC = 'scene'
MAX_LAG = 0.25  # s that are caught up; a camera later than that is slower than its rate
LOG_PERIOD = 5.0  # s between two warnings of that


@dataclass(frozen=True)
class CameraSettings:
    """
    What a user can set of the camera, at start.

    Raises
    ------
    ValueError
        A value is out of its range.
    TypeError
        A value has another type than its default.

    """

    source: str = parameter(
        SYNTHETIC, 'What is seen: scene (a synthetic room), an image, a folder of images, a '
        'video, a rosbag2, or the index of a webcam.', read_only=True)
    topic: str = parameter(
        '', 'Topic of a rosbag2 to play; empty stands for the first that has images.',
        read_only=True)
    rate: float = parameter(
        30.0, 'Images per second, except of a rosbag2.', 'Hz', 0.01, 1000.0, read_only=True)
    speed: float = parameter(
        1.0, 'How many times faster than recorded a rosbag2 is played.', '', 0.001, 1000.0,
        read_only=True)
    loop: bool = parameter(
        True, 'Start again at the end; else the node ends there.', read_only=True)
    encoding: str = parameter(
        'mono8', 'Encoding of the images: mono8 or bgr8; a rosbag2 keeps its own.',
        choices=('mono8', 'bgr8'), read_only=True)
    frame_id: str = parameter(
        'camera', 'Coordinate frame of the images; a rosbag2 keeps its own.', read_only=True)
    width: int = parameter(
        640, 'Width of the synthetic scene.', 'px', 1, 8192, read_only=True)
    height: int = parameter(
        480, 'Height of the synthetic scene.', 'px', 1, 8192, read_only=True)
    lam: float = parameter(
        -0.5, 'Lambda of the division model through which the synthetic scene is seen, 1 at half '
        'the diagonal; below 0 is a barrel, 0 leaves lines straight.', '', -1.0, 0.5,
        read_only=True)
    noise: float = parameter(
        2.0, 'Standard deviation of the noise of the synthetic scene.', 'grey levels', 0.0, 100.0,
        read_only=True)
    seed: int = parameter(
        0, 'Start of all that is random in the synthetic scene.', '', 0, 2147483647,
        read_only=True)

    def __post_init__(self) -> None:
        """Check types and ranges."""
        check(self)


class CameraNode(Node):
    """
    Publishes the images of a source on ``image``.

    Raises
    ------
    ParameterError
        A parameter given at start cannot be used.
    SourceError
        The source is not there or cannot be read.

    """

    def __init__(self) -> None:
        super().__init__('camera')
        declaration.attach(self, (CameraSettings,), self._apply)
        declaration.warn_of_unknown(self)
        self._publisher = self.create_publisher(
            Image, 'image', QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE),
            # Whoever begins to listen wakes the executor.
            event_callbacks=PublisherEventCallbacks(matched=lambda _: None),
            qos_overriding_options=QoSOverridingOptions.with_default_policies())
        self._due = 0.0  # when the next frame is, on the monotonic clock
        self._source = open_camera(self._settings, self.get_logger().warning)
        if self._source.note:
            self.get_logger().info(f'{self._source.note}: set topic to choose')
        self._kernels = Kernels(self, 'qflsd_ros.sources', self._source.warm_up)

    def run(self) -> None:
        """Publish the source's frames when they are due, and answer services in between."""
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self)
        while not self._kernels.ready:
            executor.spin_once()
        for frame in self._frames():
            executor.spin_once(0)
            while (wait := self._due - time.monotonic()) > 0:
                executor.spin_once(wait)
            self._await_listener(executor)
            self._publisher.publish(self._message(frame))
        self._publisher.wait_for_all_acked(Duration(seconds=1))

    def _apply(self, settings: CameraSettings) -> None:
        self._settings = settings

    def _await_listener(self, executor: Executor) -> None:
        """Stand still while nobody looks, if the source allows that, and go on at its pace."""
        if self._source.on_demand and not self._publisher.get_subscription_count():
            while not self._publisher.get_subscription_count():
                executor.spin_once()
            self._due = time.monotonic()

    def _frames(self) -> Iterator[Frame]:
        """Yield every frame, ready before its time, and set that time."""
        last = None
        for _ in itertools.count() if self._settings.loop else range(1):
            for frame in self._source:
                now = time.monotonic()
                fresh = last is None or self._source.live
                self._due = now if fresh else self._due + self._gap(last, frame)
                last = frame
                if now - self._due > MAX_LAG:
                    self.get_logger().warning(
                        f'cannot keep its rate: {self._source.name} is '
                        f'{now - self._due:.3f} s late',
                        throttle_duration_sec=LOG_PERIOD)
                    self._due = now
                yield frame

    def _gap(self, last: Frame, frame: Frame) -> float:
        """Return the time in s from the last frame to this one."""
        if last.recorded is None or frame.recorded is None or frame.recorded < last.recorded:
            return 1 / self._settings.rate
        return (frame.recorded - last.recorded) * 1e-9 / self._settings.speed

    def _message(self, frame: Frame) -> Image:
        stamp = self.get_clock().now().nanoseconds if frame.stamp is None else frame.stamp
        frame_id = self._settings.frame_id if frame.frame_id is None else frame.frame_id
        message = Image(height=frame.height, width=frame.width, encoding=frame.encoding,
                        is_bigendian=int(frame.is_bigendian), step=frame.step)
        message.header.stamp = Time(sec=stamp // 10**9, nanosec=stamp % 10**9)
        message.header.frame_id = frame_id
        # The setter checks every element of anything but an array.
        message.data = array('B', frame.data)
        return message


def open_camera(settings: CameraSettings, report: Callable[[str], None]) -> Source:
    """Open the source that is set; raises :class:`SourceError`."""
    colour = settings.encoding == 'bgr8'
    if settings.source == SYNTHETIC:
        return SceneFrames(Scene(settings.width, settings.height, settings.lam, settings.noise,
                                 settings.seed, colour))
    return open_source(settings.source, colour, settings.topic, settings.rate, report)


def main() -> int:
    """Run the node until SIGINT, SIGTERM or the source's end; return the exit code."""
    return run('camera', CameraNode)
