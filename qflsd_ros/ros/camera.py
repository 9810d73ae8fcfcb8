"""
The ``camera`` node: images from the synthetic scene, files, a video, a webcam or a rosbag2.

It publishes reliably, as REP 2003 recommends for drivers, because such a publisher matches
subscriptions of either reliability.  A slow subscriber never delays it, because the queue keeps
only the last few images, of the largest only one.
"""
from __future__ import annotations

from array import array
from collections.abc import Iterator
import ctypes
from dataclasses import dataclass
import itertools
import time
from typing import Callable

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from qflsd_ros.core.parameters import check, parameter
from qflsd_ros.ros.input.subscriptions import calibration_topic
from qflsd_ros.ros.kernels import Kernels
from qflsd_ros.ros.output import camera_info, orientation
from qflsd_ros.ros.parameters import declaration
from qflsd_ros.ros.run import run
from qflsd_ros.sources import Frame, open_source, Scene, SceneFrames, Source
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

SYNTHETIC = 'scene'
MAP = 'map'         # frame of the poses, by REP 105
# A shorter delay is caught up; a longer one, a few frames of a usual camera, means that the source
# cannot keep its rate.
MAX_LAG = 0.25      # s
# rclpy misses a signal that comes between its look at the context and the wait: each wait has an
# end, so that the next look sees that the context is shut down.
LONGEST_WAIT = 1.0  # s, short enough for whoever presses Ctrl-C, and too long to use CPU time
DEPTH = 5           # messages that a publisher keeps for slow subscribers; chosen, not tuned
# Bytes of images that the publisher keeps, if it knows their size: five of 1920x1080 px in colour.
MOST_QUEUED = 2 ** 25
MMAP_THRESHOLD = -3     # M_MMAP_THRESHOLD of mallopt(3)
LARGE = 2 ** 20     # bytes, from which an array is returned; chosen, not tuned
LOG_PERIOD = 5.0    # s between two warnings of a longer delay, few enough to read


@dataclass(frozen=True)
class CameraSettings:
    """
    Parameters of the camera, all of which are read at start only.

    Raises
    ------
    ValueError
        A value is out of its range.
    TypeError
        A value has another type than its default.

    """

    source: str = parameter(
        SYNTHETIC, 'Source of the images: scene (a synthetic room), an image file, a folder of '
        'images (with sequence.json also poses and calibration), a video file, a rosbag2, or the '
        'index of a webcam.', read_only=True)
    topic: str = parameter(
        '', 'Image topic of a rosbag2 to play; empty selects the first one.', read_only=True)
    rate: float = parameter(
        30.0, 'Images per second; a rosbag2 or sequence is played at its recorded rate instead.',
        'Hz', 0.01, 1000.0, read_only=True)
    speed: float = parameter(
        1.0, 'Factor by which a rosbag2 or sequence is played faster than it was recorded.',
        '', 0.001, 1000.0, read_only=True)
    loop: bool = parameter(
        True, 'Start again after the last image; otherwise the node ends there.', read_only=True)
    encoding: str = parameter(
        'mono8', 'Encoding of the images: mono8 or bgr8; a rosbag2 keeps its own.',
        choices=('mono8', 'bgr8'), read_only=True)
    frame_id: str = parameter(
        'camera', 'Coordinate frame of the images; a rosbag2 keeps its own.', read_only=True)
    width: int = parameter(
        640, 'Width of images of the synthetic scene.', 'px', 1, 8192, read_only=True)
    height: int = parameter(
        480, 'Height of images of the synthetic scene.', 'px', 1, 8192, read_only=True)
    lam: float = parameter(
        -0.5, 'Lambda of the division model of the synthetic lens, with half the image diagonal '
        'as the unit of length; negative values are barrel distortion, 0 is no distortion.',
        '', -1.0, 0.5, read_only=True)
    noise: float = parameter(
        2.0, 'Standard deviation of the noise in images of the synthetic scene.', 'grey levels',
        0.0, 100.0, read_only=True)
    seed: int = parameter(
        0, 'Seed of the random numbers of the synthetic scene.', '', 0, 2147483647,
        read_only=True)

    def __post_init__(self) -> None:
        """Check types and ranges."""
        check(self)


class CameraNode(Node):
    """
    Publishes the images of a source on ``image``.

    ``camera_info`` beside it and ``pose`` exist only if the source knows them.  Both precede their
    image, so that a subscriber has them when the image arrives.

    Raises
    ------
    ParameterError
        A parameter given at start cannot be used.
    SourceError
        The source does not exist or cannot be read.

    """

    def __init__(self) -> None:
        super().__init__('camera')
        declaration.attach(self, (CameraSettings,), self._apply)
        self._due = 0.0  # time of the next frame, s on the monotonic clock
        self._source = open_camera(self._settings, self.get_logger().warning)
        self._publisher = self._advertise(Image, 'image', queue_depth(self._source.frame_size))
        self._calibration = None if self._source.camera is None else self._advertise(
            CameraInfo, calibration_topic(self.resolve_topic_name('image')))
        self._pose = self._advertise(PoseStamped, 'pose') if self._source.posed else None
        declaration.warn_of_unknown(self)   # now that publishers have declared their QoS
        if self._source.note:
            self.get_logger().info(f'{self._source.note}: parameter topic chooses another one')
        self._kernels = Kernels(self, 'qflsd_ros.sources', self._source.warm_up)

    def run(self) -> None:
        """Publish each frame when it is due, and answer services in between."""
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self)
        while not self._kernels.ready:
            executor.spin_once(LONGEST_WAIT)
        for frame in self._frames():
            executor.spin_once(0)
            while (wait := self._due - time.monotonic()) > 0:
                executor.spin_once(min(wait, LONGEST_WAIT))
            self._await_listener(executor)
            self._publish(frame)
            del frame   # not to be kept while the next one is read
        self._publisher.wait_for_all_acked(Duration(seconds=1))

    def _advertise(self, message_type: type, topic: str, depth: int = DEPTH) -> Publisher:
        return self.create_publisher(
            message_type, topic, QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE),
            # The callback has nothing to do: the event wakes the executor, which then looks.
            event_callbacks=PublisherEventCallbacks(matched=lambda _: None),
            qos_overriding_options=QoSOverridingOptions.with_default_policies())

    def _apply(self, settings: CameraSettings) -> None:
        self._settings = settings

    def _await_listener(self, executor: Executor) -> None:
        """Wait for a subscriber before the next frame, if the source permits that."""
        if self._source.on_demand and not self._publisher.get_subscription_count():
            while not self._publisher.get_subscription_count():
                executor.spin_once(LONGEST_WAIT)
            self._due = time.monotonic()

    def _frames(self) -> Iterator[Frame]:
        """Yield every frame before its time, and set that time."""
        last: int | None = None
        is_first = True
        for _ in itertools.count() if self._settings.loop else range(1):
            for frame in self._source:
                now = time.monotonic()
                if is_first or self._source.live:
                    self._due = now
                else:
                    self._due += self._gap(last, frame.recorded)
                last, is_first = frame.recorded, False
                if now - self._due > MAX_LAG:
                    self.get_logger().warning(
                        f'cannot keep its rate: {self._source.name} is '
                        f'{now - self._due:.3f} s late',
                        throttle_duration_sec=LOG_PERIOD)
                    self._due = now
                yield frame
                del frame

    def _gap(self, last: int | None, recorded: int | None) -> float:
        """Return the time in s between two successive frames that were recorded at times in ns."""
        if last is None or recorded is None or recorded < last:
            return 1 / self._settings.rate
        return (recorded - last) * 1e-9 / self._settings.speed

    def _publish(self, frame: Frame) -> None:
        """Publish calibration and pose, as far as they are known, and the image."""
        stamp = self.get_clock().now().nanoseconds if frame.stamp is None else frame.stamp
        time_ = Time(sec=stamp // 10**9, nanosec=stamp % 10**9)
        header = Header(stamp=time_, frame_id=self._settings.frame_id if frame.frame_id is None
                        else frame.frame_id)
        if self._calibration and self._source.camera:
            self._calibration.publish(camera_info.calibrated(
                header, self._source.camera, frame.height, frame.width))
        if self._pose and frame.pose is not None:
            self._pose.publish(orientation.pose(
                Header(stamp=time_, frame_id=MAP), frame.pose))
        self._publisher.publish(_image(header, frame))


def queue_depth(size: int | None) -> int:
    """Return how many images of a size in bytes the publisher keeps, None for any size."""
    return DEPTH if size is None else max(1, min(DEPTH, MOST_QUEUED // size))


def _image(header: Header, frame: Frame) -> Image:
    message = Image(header=header, height=frame.height, width=frame.width,
                    encoding=frame.encoding, is_bigendian=int(frame.is_bigendian),
                    step=frame.step)
    # Of any other type than array, the setter would check every single element.
    message.data = array('B', frame.data)
    return message


def open_camera(settings: CameraSettings, report: Callable[[str], None]) -> Source:
    """Return the source that the settings select; SourceError if it cannot be opened."""
    colour = settings.encoding == 'bgr8'
    if settings.source == SYNTHETIC:
        return SceneFrames(Scene(settings.width, settings.height, settings.lam, settings.noise,
                                 settings.seed, colour), report)
    return open_source(settings.source, colour, settings.topic, settings.rate, report)


def return_large_arrays() -> None:
    """
    Have the C library return the memory of each large array when it is freed.

    By itself it keeps arrays of up to 32 MB for later ones, and an image passes through half a
    dozen: 4K in colour takes 150 MB more.  Where this does not exist, as in musl, nothing happens.
    """
    if mallopt := getattr(ctypes.CDLL(None), 'mallopt', None):
        mallopt(MMAP_THRESHOLD, LARGE)


def main() -> int:
    """Run the node until SIGINT, SIGTERM or the end of the source; return the exit code."""
    return_large_arrays()
    return run('camera', CameraNode)
