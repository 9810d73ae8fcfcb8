"""
The attitude of single images and of a live camera, and its focal length; imports no ROS.

Nothing is computed while the parameter ``attitude`` is off.
"""
from __future__ import annotations

import math

import numpy as np
from qflsd_ros.core import Arcs, Attitude, AttitudeTracker
from qflsd_ros.core.attitude.estimation import attitude_of
from qflsd_ros.core.attitude.solution import Unobservable
from qflsd_ros.core.attitude.view import Lens
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.ros.parameters.node_parameters import Settings, UP_HINTS
from qflsd_ros.sources.frames import FrameError
from qflsd_ros.sources.reasons import Reason

LOADING = 'its kernels are still being loaded or compiled'
OFF = 'parameter attitude is false: must be true for ~/attitude and ~/gravity'


class AttitudeError(FrameError):
    """An output needs the attitude, which the image does not show."""


class CameraAttitude:
    """
    Attitude and focal length of one camera, as far as they are known.

    One thread may call :meth:`follow` while another one calls :meth:`values`.

    Attributes
    ----------
    attitude
        That of the last frame; None where its arcs do not show one, and while it is off.
    reason
        Why it is None.

    """

    def __init__(self) -> None:
        self.attitude: Attitude | None = None
        self.reason = OFF
        self._hint = ''
        self._restart('-y')

    def _restart(self, hint: str) -> None:
        """Begin anew where the hint has changed."""
        if hint != self._hint:
            self._hint = hint
            # By the lens as the arcs show it, and by the calibration.
            self._own, self._calibrated = (AttitudeTracker(UP_HINTS[hint]) for _ in range(2))

    def follow(self, arcs: Arcs, shape: tuple[int, int], settings: Settings, lens: Lens,
               calibration: CameraModel | None) -> Attitude | None:
        """
        Return the attitude of the next frame.

        Parameters
        ----------
        arcs, shape
            The arcs of the frame, and its (height, width).
        settings
            Whether attitude and focal length are wanted, and where up is about.
        lens
            The lens as the arcs show it, None while it is unknown.
        calibration
            The calibrated camera, None without one: it counts instead of the lens.  The focal
            length by the arcs is estimated all the same.

        """
        if not settings.attitude:
            self.attitude, self.reason = None, OFF
            return None
        self._restart(settings.up_hint)
        tracker = self._own
        tracker.add(arcs, shape, lens, given_focal(settings))
        if calibration is not None:
            tracker = self._calibrated
            tracker.add(arcs, shape, calibration)
        self.attitude, self.reason = tracker.attitude, tracker.reason
        return self.attitude

    @property
    def focal(self) -> tuple[float, float] | None:
        """Return the focal length by the arcs and its deviation, px; None while unknown."""
        return self._own.focal

    def values(self, settings: Settings) -> dict[str, str]:
        """Return the state as keys and values of diagnostics."""
        if not settings.attitude:
            return {}
        attitude, focal = self.attitude, self.focal
        values = {'attitude': self.reason if attitude is None else 'known'}
        if attitude is not None and attitude.up is not None and attitude.up_std is not None:
            roll, pitch = roll_and_pitch(attitude.up)
            values |= {'roll (degrees)': f'{roll:.2f}', 'pitch (degrees)': f'{pitch:.2f}',
                       'up deviation (degrees)': f'{math.degrees(attitude.up_std):.2f}'}
        if attitude is not None and attitude.reasons:
            values['attitude not observable'] = '; '.join(attitude.reasons)
        if focal is not None:
            values |= {'focal length (px)': f'{focal[0]:.1f}',
                       'focal length deviation (px)': f'{focal[1]:.1f}'}
        return values


def of_image(arcs: Arcs, shape: tuple[int, int], settings: Settings, lens: Lens
             ) -> tuple[Attitude | None, str]:
    """Return the attitude of a single image, or None and the reason why."""
    if not settings.attitude:
        return None, OFF
    try:
        return attitude_of(arcs, shape, lens, given_focal(settings),
                           UP_HINTS[settings.up_hint]), ''
    except Unobservable as error:
        return None, str(error)


def given_focal(settings: Settings) -> float | None:
    """Return the focal length that the parameters give, px; None if they give none."""
    return settings.focal_length if settings.focal == 'fixed' else None


def roll_and_pitch(up: np.ndarray) -> tuple[float, float]:
    """
    Return roll and pitch of a camera, degrees; both are 0 for an upright, level camera.

    Roll is positive if the camera leans to its right, pitch if it looks upwards.
    """
    x, y, z = up.tolist()
    return math.degrees(math.atan2(-x, -y)), math.degrees(math.asin(min(max(z, -1.0), 1.0)))


def required(attitude: Attitude | None, reason: str) -> Attitude:
    """Return an attitude with up; AttitudeError with the reason if there is none."""
    if attitude is None:
        raise AttitudeError(Reason.NO_ATTITUDE, reason)
    if attitude.up is None:
        raise AttitudeError(Reason.NO_ATTITUDE, '; '.join(attitude.reasons))
    return attitude
