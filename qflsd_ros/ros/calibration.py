"""The live check of the camera_info beside the images against the arcs of straight edges."""
from __future__ import annotations

import math

from diagnostic_msgs.msg import DiagnosticStatus
from qflsd_ros.core import Arcs, DivisionModel
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.remaining_bend import Bend, BendTracker
from qflsd_ros.ros.input.subscriptions import CalibrationSubscription
from qflsd_ros.ros.output.camera_info import CalibrationError, camera_model
from qflsd_ros.ros.parameters.node_parameters import Settings

# Deviations from which on a bend above max_bend is significant, and a focal length is another one.
# Normal errors exceed 2 on one side in 2 %, and 3 in 0.3 % of cases; chosen, not tuned.
SIGNIFICANT, OTHER_FOCAL = 2.0, 3.0

Verdict = tuple[bytes, str, dict[str, str]]


def calibrated(subscription: CalibrationSubscription, shape: tuple[int, int]
               ) -> CameraModel | CalibrationError | None:
    """Return the calibrated camera of images of a shape, the error, or None without a message."""
    if subscription.newest is None:
        return None
    try:
        return camera_model(subscription.newest, subscription.topic, *shape)
    except CalibrationError as error:
        return error


class CalibrationWatch:
    """
    Watches the calibration; one thread may call :meth:`follow`, another one :meth:`verdict`.

    Attributes
    ----------
    camera
        The calibrated camera of the last frame; None without a calibration that can be used.

    """

    def __init__(self) -> None:
        self.camera: CameraModel | None = None
        self._error = ''
        self._bends = BendTracker()

    def follow(self, arcs: Arcs, shape: tuple[int, int], model: DivisionModel | None,
               camera: CameraModel | CalibrationError | None) -> None:
        """Take the arcs of the next frame; ``model`` is the lens as the arcs show it."""
        self._error = str(camera) if isinstance(camera, CalibrationError) else ''
        self.camera = camera if isinstance(camera, CameraModel) else None
        if self.camera is not None:
            self._bends.add(arcs, shape, model, self.camera)

    def verdict(self, settings: Settings, focal: tuple[float, float] | None) -> Verdict:
        """
        Return level, message and values of a status.

        ``focal`` is the focal length by the arcs and its deviation, px, None while it is unknown.
        """
        camera, bend = self.camera, self._bends.bend
        if self._error:
            return DiagnosticStatus.WARN, self._error, {}
        if camera is None:
            return DiagnosticStatus.OK, 'no camera_info: nothing to check', {}
        values, warnings = {}, []
        if bend is not None:
            values = {'remaining bend (px)': f'{bend.rms:.2f}',
                      'remaining bend deviation (px)': f'{bend.std:.2f}',
                      'share of long arcs that are straight': f'{bend.share:.2f}'}
            warnings += _bent(bend, settings.max_bend)
        given = math.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1])
        values['camera_info focal length (px)'] = f'{given:.1f}'
        if focal is not None:
            warnings += _other_focal(given, focal)
        if warnings:
            return DiagnosticStatus.WARN, '; '.join(warnings), values
        if bend is None:
            return (DiagnosticStatus.OK, 'no verdict: the images show too few long straight edges',
                    values)
        return DiagnosticStatus.OK, 'the calibration makes straight edges straight', values


def _bent(bend: Bend, limit: float) -> list[str]:
    """Return the warning of a bend that is significantly above a limit, in a list."""
    if not limit or bend.rms - SIGNIFICANT * bend.std <= limit:
        return []
    return [f'straight edges stay bent by {bend.rms:.1f} px after undistortion by camera_info '
            f'(max_bend {limit:g} px): it is not, or no longer, the calibration of this camera']


def _other_focal(given: float, focal: tuple[float, float]) -> list[str]:
    """Return the warning of a focal length that differs from that by the arcs, in a list."""
    value, std = focal
    if abs(value - given) <= OTHER_FOCAL * std:
        return []
    return [f'camera_info has a focal length of {given:.0f} px, the edges of the place show '
            f'{value:.0f} +- {std:.0f} px']
