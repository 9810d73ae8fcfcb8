"""
The live state of the camera's lens: unknown, estimated from the images, or fixed.

This module imports no ROS.
"""
from __future__ import annotations

from functools import lru_cache

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.lens.conversion import camera_info_terms, CameraInfoTerms
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.lens.estimation import LensEstimate
from qflsd_ros.core.lens.tracker import LensTracker
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources.frames import FrameError
from qflsd_ros.sources.reasons import Reason

# Why the lens is unknown, by the value of the parameter lens.
UNKNOWN = {
    'off': 'parameter lens is off: must be estimate or fixed for ~/camera_info and ~/rectified',
    'estimate': 'the lens is not known yet: the images have shown too few long straight edges '
                'away from the centre, or the centre of distortion is not in the middle of the '
                'image (parameter lens_find_centre)',
}


class LensError(FrameError):
    """An output needs the lens, which is unknown."""


class CameraLens:
    """
    The lens of one camera, as far as it is known.

    One thread may call :meth:`follow` while another one calls :meth:`values`.
    """

    def __init__(self) -> None:
        self._request: tuple[str, bool] | None = None   # settings that the tracker serves
        self._tracker = LensTracker()
        self._model: DivisionModel | None = None

    def known(self, shape: tuple[int, int], settings: Settings) -> DivisionModel | None:
        """
        Return the lens by the frames so far, None while it is unknown.

        ``shape`` is (height, width) of the next frame; an estimate for another shape is ignored.
        """
        estimate = self._tracking(settings).estimate
        if settings.lens == 'fixed':
            return fixed(settings, shape)
        return estimate.model if estimate and estimate.model.shape == shape else None

    def follow(self, arcs: Arcs, shape: tuple[int, int],
               settings: Settings) -> DivisionModel | None:
        """Update the estimate with the arcs of a frame; return the lens, None while unknown."""
        if settings.lens == 'estimate':
            self._tracking(settings).add(arcs, shape)
        self._model = self.known(shape, settings)
        return self._model

    def estimate(self, settings: Settings) -> LensEstimate | None:
        """Return the estimate from the frames so far; None without one, or if not wanted."""
        return self._tracking(settings).estimate if settings.lens == 'estimate' else None

    def _tracking(self, settings: Settings) -> LensTracker:
        """Return the tracker, a new one whenever the settings of the estimate have changed."""
        request = settings.lens, settings.lens_find_centre
        if request != self._request:
            self._request, self._tracker = request, LensTracker(settings.lens_find_centre)
        return self._tracker

    def values(self, settings: Settings) -> dict[str, str]:
        """Return the state of the lens as keys and values of diagnostics."""
        model, tracker = self._model, self._tracker
        values = {'lens': settings.lens}
        if model is None:
            return values
        values |= {'lens lambda': f'{model.lam:.4f}',
                   'lens centre (px)': '{:.1f}, {:.1f}'.format(*model.origin)}
        estimate = tracker.estimate  # read once: the detection thread may reset it meanwhile
        if settings.lens == 'estimate' and estimate:
            values |= _estimated(estimate, tracker.outliers)
        found = described(model, settings.focal_length)
        return values | {'camera_info model': found.distortion_model,
                         'camera_info radius (px)': f'{found.radius:.0f}',
                         'camera_info residual (px)': f'{found.residual:.3f}'}


def _estimated(estimate: LensEstimate, outliers: int) -> dict[str, str]:
    """Return keys and values of diagnostics on an estimate."""
    return {'lens lambda deviation': f'{estimate.std:.4f}',
            'lens centre deviation (px)': f'{estimate.centre_std:.1f}',
            'lens arcs that agree': str(estimate.agreeing),
            'lens share of arcs that agree': f'{estimate.share:.2f}',
            'lens outlier frames': str(outliers)}


def fixed(settings: Settings, shape: tuple[int, int]) -> DivisionModel:
    """Return the lens that the parameters give, for images of a shape (height, width)."""
    x, y = DivisionModel(0.0, shape).origin.tolist()
    return DivisionModel(settings.lens_lambda, shape,
                         (settings.lens_centre_x or x, settings.lens_centre_y or y))


@lru_cache(maxsize=2)
def described(model: DivisionModel, focal_length: float) -> CameraInfoTerms:
    """Return the terms of CameraInfo for a lens; cached, because a lens rarely changes."""
    return camera_info_terms(model, focal_length)


def required(model: DivisionModel | None, settings: Settings) -> DivisionModel:
    """Return the lens; LensError with the reason if it is unknown."""
    if model is None:
        raise LensError(Reason.NO_LENS, UNKNOWN[settings.lens])
    return model
