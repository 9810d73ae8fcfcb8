"""
The ``detector`` node: images in, arcs out.

The executor's thread receives images and answers parameter services; a thread of its own detects.
Between them lies one place: when images come faster than they are worked off, the newest wins,
so results never grow old, and every image left out is counted.
"""
from __future__ import annotations

from threading import Thread
import time
import traceback
from typing import Any, Callable, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
from qflsd_ros.core import Arcs, Detector, Parameters
from qflsd_ros.core.geometry.planes import planes
from qflsd_ros.core.lens import estimation
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.lens.estimation import with_straightness
from qflsd_ros.ros import lens
from qflsd_ros.ros.diagnostics import Statistics
from qflsd_ros.ros.finding import find
from qflsd_ros.ros.input import compressed, images
from qflsd_ros.ros.input.lazy import LazySubscription
from qflsd_ros.ros.input.losses import Losses
from qflsd_ros.ros.input.region import read_mask
from qflsd_ros.ros.input.slot import Slot
from qflsd_ros.ros.kernels import Kernels
from qflsd_ros.ros.output import camera_info, clouds
from qflsd_ros.ros.output.markers import markers
from qflsd_ros.ros.parameters import declaration
from qflsd_ros.ros.parameters.declaration import ParameterError
from qflsd_ros.ros.parameters.node_parameters import check_together, NodeParameters
from qflsd_ros.ros.run import run
from qflsd_ros.sources.frames import FrameError, SourceError
from qflsd_ros.sources.reasons import Reason
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import (
    PublisherEventCallbacks, QoSMessageLostInfo, SubscriptionEventCallbacks)
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

DIAGNOSTICS_PERIOD = 1.0  # s
CLOSE_TIMEOUT = 2.0  # s
LOG_PERIOD = 5.0  # s between two log lines on bad frames of the same kind
INPUT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class Frame(NamedTuple):
    """A message that came in, and when: ``time.monotonic()`` in s."""

    message: Image | CompressedImage
    arrival: float


class Result(NamedTuple):
    """What was found in a grey frame, and what to know for publishing it."""

    header: Header
    gray: np.ndarray
    arcs: Arcs
    settings: NodeParameters
    lens: DivisionModel | None


class Transport(NamedTuple):
    """A way for images to come: message type, what it appends to the topic, how to read it."""

    message_type: type
    suffix: str
    read: Callable[..., np.ndarray]


TRANSPORTS = {
    'raw': Transport(Image, '', images.read),
    'compressed': Transport(CompressedImage, '/compressed', compressed.decode),
}


def _warm_up() -> None:
    Detector().warm_up()
    estimation.warm_up()


def _segments(result: Result) -> PointCloud2:
    return clouds.segments(result.header, result.arcs, result.settings.polyline_tolerance)


def _arcs(result: Result) -> PointCloud2:
    return clouds.arc_records(result.header, result.arcs)


def _markers(result: Result) -> bytes:
    return markers(result.header, result.arcs, result.settings.polyline_tolerance,
                   result.settings.metres_per_pixel, result.settings.line_width,
                   result.settings.marker_colour)


def _overlay(result: Result) -> Image:
    return clouds.overlay_image(
        result.header, result.gray, result.arcs, result.settings.line_width)


def _camera_info(result: Result) -> CameraInfo:
    return camera_info.camera_info(result.header, lens.required(result.lens, result.settings),
                                   result.settings.focal_length)


def _rectified(result: Result) -> PointCloud2:
    return clouds.rectified(result.header, result.arcs,
                            lens.required(result.lens, result.settings))


OUTPUTS = (
    ('~/segments', PointCloud2, _segments),
    ('~/arcs', PointCloud2, _arcs),
    ('~/markers', MarkerArray, _markers),
    ('~/overlay', Image, _overlay),
    ('~/camera_info', CameraInfo, _camera_info),
    ('~/rectified', PointCloud2, _rectified),
)
WITH_LENS = {'~/arcs', '~/camera_info', '~/rectified'}
WITH_CALIBRATION = '~/planes'


class DetectorNode(Node):
    """
    Detects arcs in images; see the package's README for topics and parameters.

    Raises
    ------
    ParameterError
        A parameter given at start cannot be used.
    rclpy.exceptions.ParameterException, RuntimeError
        The same of a QoS override or of use_sim_time.

    """

    def __init__(self) -> None:
        super().__init__('detector')
        declaration.attach(self, (Parameters, NodeParameters), self._apply, check_together)
        self._read_mask()
        self._statistics = Statistics()
        self._last_log: dict[str, float] = {}
        self._slot: Slot[Frame] = Slot()
        self._lens = lens.CameraLens()
        self._outputs = {topic: (self._advertise(type_, topic), build) for topic, type_, build
                         in (*OUTPUTS, (WITH_CALIBRATION, PointCloud2, self._planes_of))}
        self._diagnostics = self._advertise(DiagnosticArray, '/diagnostics')
        self._camera_info: CameraInfo | None = None
        self._losses = Losses(self._cameras)
        self._images = LazySubscription(self, self._subscribe)
        self._calibration = LazySubscription(self, self._subscribe_calibration)
        declaration.warn_of_unknown(self)
        self.create_timer(DIAGNOSTICS_PERIOD, self._diagnose,
                          clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._worker = Thread(target=self._work, name='detection', daemon=True)
        self._kernels = Kernels(self, 'qflsd_ros.core', _warm_up, self._begin)
        self._follow_listeners()

    def run(self) -> None:
        """Work until the node is shut down."""
        try:
            rclpy.spin(self)
        finally:
            self._slot.close()
            if self._worker.is_alive():
                self._worker.join(CLOSE_TIMEOUT)  # unless a frame takes it too long
            self.destroy_node()

    def _begin(self) -> None:
        """Take images from now on: kernels are ready."""
        self._worker.start()
        self._follow_listeners()

    def _read_mask(self) -> None:
        """Read the mask now, if there is one: later, nobody can make the node read a file."""
        if path := self._active[1].mask:
            try:
                read_mask(path)
            except SourceError as error:
                raise ParameterError(f'parameter mask: {error}') from error

    @property
    def _image_topic(self) -> str:
        return self.resolve_topic_name('image')

    @property
    def _frame_topic(self) -> str:
        # The suffix follows the remapped name, as with image_transport.
        return self._image_topic + self._transport.suffix

    def _cameras(self) -> frozenset[bytes]:
        return frozenset(bytes(camera.endpoint_gid) for camera
                         in self.get_publishers_info_by_topic(self._frame_topic))

    @property
    def _transport(self) -> Transport:
        return TRANSPORTS[self._active[1].image_transport]

    def _apply(self, detector: Parameters, settings: NodeParameters) -> None:
        # One assignment: the detection thread never sees half a change.
        self._active = Detector(detector), settings

    def _advertise(self, type_: type, topic: str) -> Publisher:
        return self.create_publisher(
            type_, topic, QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE),
            event_callbacks=PublisherEventCallbacks(matched=lambda _: self._follow_listeners()),
            qos_overriding_options=QoSOverridingOptions.with_default_policies())

    def _subscribe(self) -> Subscription:
        self._losses.begin_anew()
        return self.create_subscription(
            self._transport.message_type, self._frame_topic, self._receive, INPUT,
            event_callbacks=SubscriptionEventCallbacks(
                message_lost=self._count_lost, matched=lambda _: self._losses.begin_anew()),
            qos_overriding_options=QoSOverridingOptions.with_default_policies())

    def _subscribe_calibration(self) -> Subscription:
        return self.create_subscription(
            CameraInfo, camera_info.topic_of(self._image_topic), self._calibrate, INPUT,
            qos_overriding_options=QoSOverridingOptions.with_default_policies())

    def _follow_listeners(self) -> None:
        """Be subscribed to the camera just as long as somebody listens to the results."""
        heard = self._heard() if self._kernels.ready else set()
        self._images.follow(bool(heard))
        self._calibration.follow(WITH_CALIBRATION in heard)
        if WITH_CALIBRATION not in heard:
            self._camera_info = None  # it may be another one by the time it is wanted again

    def _calibrate(self, message: CameraInfo) -> None:
        self._camera_info = message

    def _receive(self, message: Image | CompressedImage, info: dict[str, Any]) -> None:
        self._statistics.arrived()
        self._statistics.lost(self._losses.missing(info.get('publication_sequence_number')))
        if self._slot.put(Frame(message, time.monotonic())):
            self._statistics.dropped()

    def _count_lost(self, event: QoSMessageLostInfo) -> None:
        self._statistics.lost(self._losses.reported(event.total_count_change))

    def _work(self) -> None:
        for frame in self._slot:
            try:
                self._process(frame)
            except FrameError as error:
                self._reject(error.reason, str(error))
            except Exception:
                # No frame may end the node.
                self._reject(Reason.INTERNAL.phrase, traceback.format_exc())

    def _process(self, frame: Frame) -> None:
        detector, settings = self._active
        header = frame.message.header
        gray = self._transport.read(
            frame.message, settings.white_level, settings.max_pixels)
        # Whoever listens: what is found in the next frame depends on the lens.
        arcs, model = find(gray, detector, settings, self._lens)
        heard = self._heard()
        if heard & WITH_LENS:
            arcs = with_straightness(arcs, model)
        self._publish(Result(header, gray, arcs, settings, model), heard)
        self._statistics.done(time.monotonic() - frame.arrival, self._age(header), len(arcs))

    def _heard(self) -> set[str]:
        """Return the topics that somebody listens to."""
        return {topic for topic, (publisher, _) in self._outputs.items()
                if publisher.get_subscription_count()}

    def _publish(self, result: Result, heard: set[str]) -> None:
        """Build and publish what is listened to; what cannot be built keeps back nothing else."""
        errors: dict[str, str] = {}
        for topic, (publisher, build) in self._outputs.items():
            try:
                if topic in heard:
                    publisher.publish(build(result))
            except FrameError as error:
                errors[error.reason] = str(error)
            except Exception:
                errors[Reason.INTERNAL.phrase] = traceback.format_exc()
        for reason, text in errors.items():
            self._reject(reason, text)

    def _planes_of(self, result: Result) -> PointCloud2:
        topic = camera_info.topic_of(self._image_topic)
        camera = camera_info.lens(self._camera_info, topic, *result.gray.shape)
        return clouds.plane_records(result.header, planes(result.arcs, camera))

    def _age(self, header: Header) -> float:
        stamp = header.stamp.sec * 10**9 + header.stamp.nanosec
        return (self.get_clock().now().nanoseconds - stamp) * 1e-9

    def _reject(self, reason: str, text: str) -> None:
        if not self.context.ok():
            return  # after a shutdown, publishing fails as it should
        self._statistics.bad(reason)
        now = time.monotonic()
        if now - self._last_log.get(reason, -LOG_PERIOD) >= LOG_PERIOD:
            self._last_log[reason] = now
            self.get_logger().error(f'{reason}: {text}')

    def _diagnose(self) -> None:
        settings = self._active[1]
        status = DiagnosticStatus(name=f'{self.get_fully_qualified_name()}: detection',
                                  hardware_id=settings.hardware_id or self._frame_topic)
        self._statistics.report(status, bool(self._images), settings.max_age)
        if compiling := self._kernels.compiling:
            status.level, status.message = DiagnosticStatus.WARN, compiling
        status.values += [KeyValue(key=key, value=value)
                          for key, value in self._lens.values(settings).items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def main() -> int:
    """Run the node until SIGINT or SIGTERM; return the exit code."""
    return run('detector', DetectorNode)
