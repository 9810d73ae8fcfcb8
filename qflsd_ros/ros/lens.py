"""The lens of the camera: unknown, estimated from its images or fixed; imports no ROS."""
from __future__ import annotations

from functools import lru_cache

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.lens.conversion import camera_info_terms, CameraInfoTerms
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.lens.estimation import LensEstimate
from qflsd_ros.core.lens.tracker import LensTracker
from qflsd_ros.ros.parameters.node_parameters import NodeParameters
from qflsd_ros.sources.frames import FrameError
from qflsd_ros.sources.reasons import Reason

UNKNOWN = {
    'off': 'parameter lens is off: must be estimate or fixed for ~/camera_info and ~/rectified',
    'estimate': 'the lens is not known yet: too few long straight edges away from the centre, or '
                'a centre of distortion that is not in the middle of the image '
                '(lens_find_centre)',
}


class LensError(FrameError):
    """A lens that is asked for and not known."""


class CameraLens:
    """What is known of the lens; one thread may follow the frames and another one report."""

    def __init__(self) -> None:
        self._asked: tuple[str, bool] | None = None
        self._tracker = LensTracker()
        self._model: DivisionModel | None = None

    def known(self, shape: tuple[int, int], settings: NodeParameters) -> DivisionModel | None:
        """Return the lens of images of a shape by what came so far, None where that is nothing."""
        estimate = self._tracking(settings).estimate
        if settings.lens == 'fixed':
            return fixed(settings, shape)
        return estimate.model if estimate and estimate.model.shape == shape else None

    def follow(self, arcs: Arcs, shape: tuple[int, int],
               settings: NodeParameters) -> DivisionModel | None:
        """Take in the arcs of the next frame; return what is known of the lens with them."""
        if settings.lens == 'estimate':
            self._tracking(settings).add(arcs, shape)
        self._model = self.known(shape, settings)
        return self._model

    def estimate(self, settings: NodeParameters) -> LensEstimate | None:
        """Return the estimate by the frames so far; None where there is none, or none is asked."""
        return self._tracking(settings).estimate if settings.lens == 'estimate' else None

    def _tracking(self, settings: NodeParameters) -> LensTracker:
        """Return the tracker, which begins anew when something else is asked for."""
        asked = settings.lens, settings.lens_find_centre
        if asked != self._asked:
            self._asked, self._tracker = asked, LensTracker(settings.lens_find_centre)
        return self._tracker

    def values(self, settings: NodeParameters) -> dict[str, str]:
        """Return what there is to say of the lens, for diagnostics."""
        model, tracker = self._model, self._tracker
        values = {'lens': settings.lens}
        if model is None:
            return values
        values |= {'lens lambda': f'{model.lam:.4f}',
                   'lens centre (px)': '{:.1f}, {:.1f}'.format(*model.origin)}
        estimate = tracker.estimate  # once: the detection thread may begin anew meanwhile
        if settings.lens == 'estimate' and estimate:
            values |= _estimated(estimate, tracker.outliers)
        found = described(model, settings.focal_length)
        return values | {'camera_info model': found.distortion_model,
                         'camera_info radius (px)': f'{found.radius:.0f}',
                         'camera_info residual (px)': f'{found.residual:.3f}'}


def _estimated(estimate: LensEstimate, outliers: int) -> dict[str, str]:
    return {'lens lambda deviation': f'{estimate.std:.4f}',
            'lens centre deviation (px)': f'{estimate.centre_std:.1f}',
            'lens arcs that agree': str(estimate.agreeing),
            'lens share of arcs that agree': f'{estimate.share:.2f}',
            'lens outlier frames': str(outliers)}


def fixed(settings: NodeParameters, shape: tuple[int, int]) -> DivisionModel:
    """Return the lens that parameters fix, for images of a shape (height, width)."""
    x, y = DivisionModel(0.0, shape).origin.tolist()
    return DivisionModel(settings.lens_lambda, shape,
                         (settings.lens_centre_x or x, settings.lens_centre_y or y))


@lru_cache(maxsize=2)
def described(model: DivisionModel, focal_length: float) -> CameraInfoTerms:
    """Return what CameraInfo says of a lens, computed anew only for another one."""
    return camera_info_terms(model, focal_length)


def required(model: DivisionModel | None, settings: NodeParameters) -> DivisionModel:
    """Return the lens; LensError where it is not known."""
    if model is None:
        raise LensError(Reason.NO_LENS, UNKNOWN[settings.lens])
    return model
