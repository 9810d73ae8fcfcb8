"""
The outputs of the detector: one row for each topic, and nothing else to change for a new one.

The node advertises every row of :data:`OUTPUTS`, and builds a message only for topics that have a
subscription.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Callable, NamedTuple

from geometry_msgs.msg import Vector3Stamped
import numpy as np
from qflsd_ros.core import Arcs, Attitude
from qflsd_ros.core.attitude.estimation import directions, with_directions
from qflsd_ros.core.geometry.planes import Planes, planes
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.lens.straightness import straightness
from qflsd_ros.core.line_features.feed import Feed, Limits
from qflsd_ros.core.line_features.undistorted import undistorted
from qflsd_ros.overlay import Tails
from qflsd_ros.ros import attitude as attitudes
from qflsd_ros.ros import lens
from qflsd_ros.ros.output import camera_info, clouds, orientation
from qflsd_ros.ros.output.line_features import line_features
from qflsd_ros.ros.output.markers import markers
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources.frames import FrameError
from qflsd_ros.sources.reasons import Reason
from sensor_msgs.msg import CameraInfo, Image, Imu, PointCloud, PointCloud2
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray


@dataclass(frozen=True)
class Result:
    """
    The arcs of one frame, and the data from which its messages are built.

    Attributes
    ----------
    header
        Header of the image message; every output carries it unchanged.
    gray
        (H, W) uint8, the frame.
    arcs
        Its arcs, in px of ``gray``.
    settings
        Parameters of the node.
    model
        The distortion model of the lens, None while it is unknown.
    tails
        The last positions of the tracks, for the overlay.
    calibration
        The newest camera_info beside the image, None if there has been none.
    calibration_topic
        Name of its topic, for error messages.
    attitude, no_attitude
        The attitude, or None and the reason why.
    focal
        The focal length by the arcs, px; None while it is unknown.
    feed
        The choice of lines for ``~/line_features``, which goes on over frames.

    """

    header: Header
    gray: np.ndarray
    arcs: Arcs
    settings: Settings
    model: DivisionModel | None
    tails: Tails
    calibration: CameraInfo | None
    calibration_topic: str
    attitude: Attitude | None = None
    no_attitude: str = attitudes.OFF
    focal: float | None = None
    feed: Feed = field(default_factory=Feed)

    @cached_property
    def arcs_with_directions(self) -> Arcs:
        """Return the arcs with the column ``direction``, made once for all outputs."""
        return with_directions(self.arcs, self.attitude)

    @cached_property
    def arcs_with_straightness(self) -> Arcs:
        """Return the arcs with the columns ``straight`` and ``direction``, made once for all."""
        return self.arcs.with_columns(straight=straightness(self.arcs, self.model),
                                      direction=directions(self.arcs, self.attitude))

    @cached_property
    def camera(self) -> CameraModel:
        """Return the calibrated camera, computed once; CalibrationError if there is none."""
        return camera_info.camera_model(
            self.calibration, self.calibration_topic, *self.gray.shape)

    @cached_property
    def planes(self) -> Planes:
        """Return the planes of the arcs, computed once; CalibrationError as of ``camera``."""
        return planes(self.arcs, self.camera)

    @property
    def stamp(self) -> int:
        """Return the stamp of the image, ns."""
        return self.header.stamp.sec * 10**9 + self.header.stamp.nanosec


class TrackingError(FrameError):
    """An output needs tracks, which the arcs do not have."""


Need = Callable[[Result], Any]


def with_straightness(result: Result) -> Arcs:
    """Return the arcs with the column ``straight``, which is nan while the lens is unknown."""
    return result.arcs_with_straightness


def distortion(result: Result) -> DivisionModel:
    """Return the distortion model of the lens; LensError while it is unknown."""
    return lens.required(result.model, result.settings)


def attitude(result: Result) -> Attitude:
    """Return the attitude with up; AttitudeError where the image does not show it."""
    return attitudes.required(result.attitude, result.no_attitude)


def calibration(result: Result) -> CameraModel:
    """Return the calibrated camera; CalibrationError if the camera_info does not give one."""
    return result.camera


def tracked(result: Result) -> Arcs:
    """Return the arcs with their tracks and directions; TrackingError without tracks."""
    if not result.arcs.is_tracked:
        raise TrackingError(
            Reason.NO_TRACKS, 'parameter tracking is false, or method is not arcs: '
            '~/line_features needs tracks')
    return result.arcs_with_directions


def every_image(result: Result) -> bool:
    """Let every image pass."""
    return True


def at_the_rate_of_line_features(result: Result) -> bool:
    """Let the images pass that are due at the rate of ~/line_features."""
    return result.feed.pace.due(result.stamp, result.settings.line_features_rate)


class Output(NamedTuple):
    """
    One topic of the detector.

    Attributes
    ----------
    topic
        Its name, relative to the node.
    message_type
        Type of its messages.
    build
        Takes a result and the values of ``needs``; returns the message, or its serialised bytes.
    needs
        Functions that take a result; each raises FrameError if it has no value for that.
    passes
        Whether an image has a message on this topic; called once for each image while the topic
        has a subscription.

    """

    topic: str
    message_type: type
    build: Callable[..., Any]
    needs: tuple[Need, ...] = ()
    passes: Callable[[Result], bool] = every_image

    def message(self, result: Result) -> Any:
        """Build the message of a result; FrameError if one of the needs cannot be met."""
        return self.build(result, *(need(result) for need in self.needs))


def _segments(result: Result) -> PointCloud2:
    return clouds.segments(result.header, result.arcs, result.settings.polyline_tolerance)


def _arcs(result: Result, arcs: Arcs) -> PointCloud2:
    return clouds.arc_records(result.header, arcs)


def _markers(result: Result) -> bytes:
    settings = result.settings
    return markers(result.header, result.arcs_with_directions, settings.polyline_tolerance,
                   settings.metres_per_pixel, settings.line_width, settings.marker_colour)


def _overlay(result: Result) -> Image:
    return clouds.overlay_image(
        result.header, result.gray, result.arcs, result.settings.line_width, result.tails,
        result.attitude if result.settings.draw_attitude else None)


def _camera_info(result: Result, model: DivisionModel) -> CameraInfo:
    if result.settings.focal == 'estimate':
        return (camera_info.uncalibrated(result.header, model) if result.focal is None
                else camera_info.message(result.header, model, result.focal))
    return camera_info.message(result.header, model, result.settings.focal_length)


def _rectified(result: Result, arcs: Arcs, model: DivisionModel) -> PointCloud2:
    return clouds.rectified(result.header, arcs, model)


def _planes(result: Result, camera: CameraModel) -> PointCloud2:
    return clouds.plane_records(result.header, result.planes, result.arcs)


def _line_features(result: Result, arcs: Arcs, camera: CameraModel) -> PointCloud:
    settings = result.settings
    lines, ids = result.feed.take(
        undistorted(arcs, result.planes, camera), arcs, result.gray.shape, Limits(
            settings.line_features_max, settings.line_features_min_length, settings.cameras,
            settings.camera_index))
    return line_features(result.header, lines, ids, arcs.table[lines.arcs])


def _attitude(result: Result, found: Attitude) -> Imu:
    return orientation.imu(result.header, found)


def _gravity(result: Result, found: Attitude) -> Vector3Stamped:
    return orientation.gravity(result.header, found)


OUTPUTS = (
    Output('~/segments', PointCloud2, _segments),
    Output('~/arcs', PointCloud2, _arcs, (with_straightness,)),
    Output('~/markers', MarkerArray, _markers),
    Output('~/overlay', Image, _overlay),
    Output('~/camera_info', CameraInfo, _camera_info, (distortion,)),
    Output('~/rectified', PointCloud2, _rectified, (with_straightness, distortion)),
    Output('~/planes', PointCloud2, _planes, (calibration,)),
    Output('~/line_features', PointCloud, _line_features, (tracked, calibration),
           at_the_rate_of_line_features),
    Output('~/attitude', Imu, _attitude, (attitude,)),
    Output('~/gravity', Vector3Stamped, _gravity, (attitude,)),
)
