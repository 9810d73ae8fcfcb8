"""
The ``detector`` node: images in, arcs out.

The executor's thread receives images and answers parameter services; a second thread detects.
Between them is a slot for one image.  When images arrive faster than they are processed, the
newest replaces the waiting one: results are never old, and every replaced image is counted.
"""
from __future__ import annotations

from collections.abc import Sequence
from threading import Thread
import time
import traceback
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from qflsd_ros.core import Attitude, Parameters, Tracker
from qflsd_ros.core.attitude import tracker as attitude_tracker
from qflsd_ros.core.lens import estimation
from qflsd_ros.core.line_features.feed import Feed
from qflsd_ros.ros import attitude as attitudes
from qflsd_ros.ros.attitude import CameraAttitude
from qflsd_ros.ros.calibration import calibrated, CalibrationWatch
from qflsd_ros.ros.diagnostics import Statistics
from qflsd_ros.ros.finding import described, FrameSequence, Seen
from qflsd_ros.ros.input.region import read_mask
from qflsd_ros.ros.input.slot import Slot
from qflsd_ros.ros.input.subscriptions import CalibrationSubscription, Frame, ImageSubscription
from qflsd_ros.ros.input.transports import TRANSPORTS
from qflsd_ros.ros.kernels import Kernels
from qflsd_ros.ros.output.publishers import advertise, Publishers
from qflsd_ros.ros.output.topics import calibration, Result
from qflsd_ros.ros.parameters import declaration
from qflsd_ros.ros.parameters.declaration import ParameterError
from qflsd_ros.ros.parameters.node_parameters import (
    check_together, Settings, tracks_lines)
from qflsd_ros.ros.run import run
from qflsd_ros.ros.tracks import TrackStatistics
from qflsd_ros.sources.frames import FrameError, SourceError
from qflsd_ros.sources.reasons import Reason
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Header

DIAGNOSTICS_PERIOD = 1.0    # s, the usual period of diagnostics in ROS
CLOSE_TIMEOUT = 2.0         # s for the frame in progress at shutdown, far more than one takes
LOG_PERIOD = 5.0            # s between log lines on bad frames of one kind, few enough to read


class DetectorNode(Node):
    """
    Detects arcs in images; the README describes its topics and parameters.

    Raises
    ------
    ParameterError
        A parameter given at start cannot be used.
    rclpy.exceptions.ParameterException, RuntimeError
        A QoS override or ``use_sim_time`` given at start cannot be used.

    """

    def __init__(self, siblings: Sequence[str] = (), **options: Any) -> None:
        """
        Take options of rclpy.node.Node, such as a namespace.

        ``siblings`` are the full names of other nodes of this process, for which parameter files
        may be meant.
        """
        super().__init__('detector', **options)
        try:
            self._set_up(siblings)
        except BaseException:
            self.destroy_node()     # others of this process must not see half of a node
            raise

    def _set_up(self, siblings: Sequence[str]) -> None:
        """Make all that the node consists of; errors are those of the class."""
        declaration.attach(self, (Parameters, Settings), self._apply, check_together)
        self._read_mask()
        self._statistics = Statistics()
        self._last_log: dict[str, float] = {}
        self._slot: Slot[Frame] = Slot()
        self._sequence, self._circle_is_logged = FrameSequence(), False
        self._tracks = TrackStatistics()
        self._attitude, self._watch = CameraAttitude(), CalibrationWatch()
        self._feed = Feed()
        self._outputs = Publishers(self, self._follow_subscribers)
        self._diagnostics = advertise(self, DiagnosticArray, '/diagnostics')
        self._transport = TRANSPORTS[self._active[1].image_transport]
        self._images = ImageSubscription(
            self, self._transport, self._receive, self._statistics.lost)
        self._calibration = CalibrationSubscription(self)
        declaration.warn_of_unknown(self, siblings)
        self.create_timer(DIAGNOSTICS_PERIOD, self._diagnose,
                          clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._worker = Thread(target=self._work, name='detection', daemon=True)
        self._kernels = Kernels(self, 'qflsd_ros.core', self._warm_up, self._begin)
        # Also those of the attitude, if it is on at start.
        self._attitude_kernels = self._kernels if self._active[1].attitude else None
        self._follow_subscribers()

    def run(self) -> None:
        """Work until the node is shut down, with an executor of its own."""
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self)
        try:
            executor.spin()
        finally:
            self._slot.close()
            if self._worker.is_alive():
                self._worker.join(CLOSE_TIMEOUT)
            self.destroy_node()

    def _begin(self) -> None:
        """Accept images from now on, because the kernels are ready."""
        self._worker.start()
        self._follow_subscribers()

    def _read_mask(self) -> None:
        """Read the mask file at start, so that nobody can make a running node read a file."""
        if path := self._active[1].mask:
            try:
                read_mask(path)
            except SourceError as error:
                raise ParameterError(f'parameter mask: {error}') from error

    def _apply(self, parameters: Parameters, settings: Settings) -> None:
        # One assignment, so that the detection thread never sees half of a change.
        self._active = parameters, settings
        if settings.tracking and not tracks_lines(parameters, settings):
            self.get_logger().info(f'method is {parameters.method}: it has no tracks, so that '
                                   'parameter tracking has no effect')

    def _follow_subscribers(self) -> None:
        """Subscribe to the camera only while the results have a subscription."""
        wanted = self._outputs.wanted() if self._kernels.ready else []
        self._images.follow(bool(wanted))
        self._calibration.follow(any(calibration in output.needs for output in wanted)
                                 or bool(wanted) and self._active[1].attitude)

    def _receive(self, frame: Frame) -> None:
        self._statistics.arrived()
        if self._slot.put(frame):
            self._statistics.dropped()

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
        parameters, settings = self._active
        header = frame.message.header
        gray = self._transport.read(frame.message, settings.white_level, settings.max_pixels)
        # Lens and tracks follow every frame, also for subscribers that need neither, because
        # detection uses both.
        seen = self._sequence.find(gray, parameters, settings)
        self._log_circle()
        attitude = self._follow_attitude(seen, gray.shape, settings)
        focal = self._attitude.focal
        result = Result(header, gray, seen.arcs, settings, seen.model, seen.tails,
                        self._calibration.newest, self._calibration.topic,
                        attitude, self._attitude.reason, focal and focal[0], self._feed)
        for reason, text in self._outputs.publish(result).items():
            self._reject(reason, text)
        self._statistics.done(time.monotonic() - frame.arrival, self._age(header), len(seen.arcs))
        self._tracks.follow(seen.arcs)

    def _log_circle(self) -> None:
        """Log the first image circle."""
        if self._sequence.circle is not None and not self._circle_is_logged:
            self._circle_is_logged = True
            self.get_logger().info(
                f'image circle found: {described(self._sequence.circle)} px; no arcs are '
                'detected at its rim and outside of it (parameter image_circle)')

    def _follow_attitude(self, seen: Seen, shape: tuple[int, int], settings: Settings
                         ) -> Attitude | None:
        """Return the attitude, None while it is off; while it is on, check the calibration too."""
        if settings.attitude and not (self._attitude_kernels and self._attitude_kernels.ready):
            # Compiling in this thread would stop detection for seconds.
            self._attitude.attitude, self._attitude.reason = None, attitudes.LOADING
            return None
        if settings.attitude:
            self._watch.follow(seen.arcs, shape, seen.model,
                               calibrated(self._calibration, shape))
        lens = self._sequence.lens.estimate(settings) or seen.model
        return self._attitude.follow(seen.arcs, shape, settings, lens, self._watch.camera)

    def _age(self, header: Header) -> float:
        """Return the time in s since the stamp of a header, on the clock of the node."""
        stamp = header.stamp.sec * 10**9 + header.stamp.nanosec
        return (self.get_clock().now().nanoseconds - stamp) * 1e-9

    def _reject(self, reason: str, text: str) -> None:
        """Count a bad frame, and log it unless one of the same kind was logged recently."""
        if not self.context.ok():
            return  # after a shutdown publishing fails, which is no fault of the frame
        self._statistics.bad(reason)
        now = time.monotonic()
        if now - self._last_log.get(reason, -LOG_PERIOD) >= LOG_PERIOD:
            self._last_log[reason] = now
            self.get_logger().error(f'{reason}: {text}')

    def _diagnose(self) -> None:
        """Publish a report on the frames since the last call on /diagnostics."""
        settings = self._active[1]
        self._follow_subscribers()      # a changed parameter may need camera_info
        if settings.attitude and self._attitude_kernels is None:
            self._attitude_kernels = Kernels(self, 'qflsd_ros.core.attitude',
                                             attitude_tracker.warm_up)
        status = DiagnosticStatus(name=f'{self.get_fully_qualified_name()}: detection',
                                  hardware_id=settings.hardware_id or self._images.topic)
        self._statistics.report(status, bool(self._images), settings.max_age)
        if compiling := self._kernels.compiling or (
                self._attitude_kernels and self._attitude_kernels.compiling):
            status.level, status.message = DiagnosticStatus.WARN, compiling
        values = self._tracks.take() | self._sequence.lens.values(settings) \
            | self._attitude.values(settings) | self._sequence.circle_values()
        status.values += [KeyValue(key=key, value=value) for key, value in values.items()]
        message = DiagnosticArray(status=[status, *self._calibration_status(settings)])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    def _warm_up(self) -> None:
        """Load or compile all kernels that the node uses."""
        Tracker().warm_up()
        estimation.warm_up()
        if self._active[1].attitude:
            attitude_tracker.warm_up()

    def _calibration_status(self, settings: Settings) -> list[DiagnosticStatus]:
        """Return a list of the calibration's status; it is empty while the attitude is off."""
        if not settings.attitude or not self._calibration:
            return []
        level, text, values = self._watch.verdict(settings, self._attitude.focal)
        return [DiagnosticStatus(
            name=f'{self.get_fully_qualified_name()}: calibration', level=level, message=text,
            hardware_id=settings.hardware_id or self._images.topic,
            values=[KeyValue(key=key, value=value) for key, value in values.items()])]


def main() -> int:
    """Run the node until SIGINT or SIGTERM; return the exit code."""
    return run('detector', DetectorNode)
