"""The arcs of one image as observations of directions, and what is known of the camera."""
from __future__ import annotations

import math
from typing import NamedTuple, Union

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.attitude.great_circles import (
    COLUMNS, excess, NORMAL_X, NORMAL_Y, observe, Observed, X, Y)
from qflsd_ros.core.attitude.refinement import Prior
from qflsd_ros.core.attitude.solution import EXACT, prior_of
from qflsd_ros.core.compilation import compiled
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.lens.estimation import estimate_distortion, LensEstimate
from qflsd_ros.core.lens.straightness import LENS_ERROR

# What may be known of a lens.
Lens = Union[LensEstimate, DivisionModel, CameraModel, None]

# Deviation of lambda beyond that of its estimate, over the same root and more, times
# (1 - lambda / 3)^2, by which the same change bends lines less.
LENS_FLAW = LENS_ERROR / 2
# Deviation of lambda about 0 where arcs do not determine it at all: most lenses.
LENS_SPREAD = 0.2
# A view is new if less than the share KNOWN of its LONGEST arcs are NEAR (half diagonals) an arc
# of another one, with a sine of the angle between them below PARALLEL.  Chosen, not tuned: an arc
# lies that near by chance in 1 of 6 cases.
KNOWN, LONGEST, NEAR, PARALLEL = 0.5, 100, 0.05, 0.17
# Distance of two points from which the direction of a mapped arc is taken, px: small against any
# detail of a distortion, large against rounding.
STEP = 1e-2


class View(NamedTuple):
    """
    The arcs of one image and the camera that took it.

    Attributes
    ----------
    observed
        Observations of the arcs, the longest first.
    arcs
        Number of arcs of the image.
    lens
        The lens of the observations: that of a stereographic camera for a calibrated one.
    deviation
        Standard deviation of its lambda.
    focal
        ln f in half diagonals and its standard deviation, if anything is known of it.
    calibration
        The calibrated camera, None for any other.

    """

    observed: Observed
    arcs: int
    lens: DivisionModel
    deviation: float
    focal: tuple[float, float] | None
    calibration: CameraModel | None

    def prior(self) -> Prior:
        """Return the prior of focal length and lens."""
        return prior_of(self.lens.lam, self.deviation, self.focal, self.calibration is not None)


def view_of(arcs: Arcs, shape: tuple[int, int], lens: Lens, focal: float | None) -> View:
    """
    Return the arcs of an image of a shape (height, width) through a lens.

    The focal length is in px.  A calibrated camera has its own.

    Raises
    ------
    ValueError
        The focal length is not above 0 or is given beside a calibration, or the lens is that of
        images of another size.

    """
    if focal is not None and not 0 < focal < math.inf:
        raise ValueError(f'focal is {focal}: must be above 0 px and finite, or None')
    if isinstance(lens, CameraModel):
        if focal is not None:
            raise ValueError(f'focal is {focal} px beside a calibrated camera, which has its own: '
                             'must be None')
        return _calibrated(arcs, shape, lens)
    model, deviation = _lens(arcs, shape, lens)
    known = None if focal is None else (math.log(focal / model.half_diagonal), EXACT)
    seen = observe(arcs, model, excess(arcs, model, deviation))
    return View(seen, len(arcs), model, deviation, known, None)


def _lens(arcs: Arcs, shape: tuple[int, int], lens: LensEstimate | DivisionModel | None
          ) -> tuple[DivisionModel, float]:
    """Return the lens to begin with, and the deviation of its lambda."""
    if lens is None:
        lens = estimate_distortion([arcs], shape, max_std=math.inf)
    if lens is None:
        return DivisionModel(0.0, shape), LENS_SPREAD
    model, std = (lens, 0.0) if isinstance(lens, DivisionModel) else (lens.model, lens.std / 2)
    if tuple(model.shape) != tuple(shape):
        raise ValueError(f'lens is that of images of {tuple(model.shape)}, shape is '
                         f'{tuple(shape)}: must be the same (height, width)')
    return model, max(std, LENS_FLAW * (1 - model.lam / 3) ** 2)


def _calibrated(arcs: Arcs, shape: tuple[int, int], camera: CameraModel) -> View:
    """
    Return arcs as a stereographic camera of the same focal length would see them.

    It has lambda = -1 / (4 f^2) exactly, sees up to 180 degrees from the axis, and keeps angles:
    those of arcs are as uncertain as in the image.
    """
    unit = float(np.hypot(*shape)) / 2
    focal = float(camera.matrix[0, 0] + camera.matrix[1, 1]) / 2 / unit
    lens = DivisionModel(-1 / (4 * focal ** 2), shape)
    raw = observe(arcs, DivisionModel(0.0, shape), _excess(arcs, camera))
    table = arcs.table[raw.arcs]
    along = table['end'] - table['start']
    along /= np.hypot(*along.T)[:, None]
    middle, ahead = (_stereographic(camera.rays(table['middle'] + step * along), focal)
                     for step in (0.0, STEP))
    along = (ahead - middle) * unit / STEP
    size = np.hypot(*along.T)
    seen = np.empty((len(table), COLUMNS))
    seen[:, X:NORMAL_X] = middle
    seen[:, NORMAL_X:-1] = np.stack([-along[:, 1], along[:, 0]], axis=1) / size[:, None]
    seen[:, -1] = raw.seen[:, -1]
    shown = np.isfinite(seen).all(axis=1)
    return View(Observed(raw.arcs[shown], seen[shown]), len(arcs), lens, 0.0,
                (math.log(focal), 0.0), camera)


def _excess(arcs: Arcs, camera: CameraModel) -> np.ndarray:
    """Return what :func:`great_circles.excess` does, of a calibrated camera."""
    table = arcs.table
    start, middle, end = (camera.rays(table[name]) for name in ('start', 'middle', 'end'))
    first, second = np.cross(start, middle), np.cross(middle, end)
    turn = np.arctan2(np.linalg.norm(np.cross(first, second), axis=1),
                      (first * second).sum(axis=1))
    spread = table['curvature_std'] * np.hypot(*(table['end'] - table['start']).T) / 2
    return np.asarray(np.maximum(turn - spread, 0.0))


def _stereographic(rays: np.ndarray, focal: float) -> np.ndarray:
    """Return the image of unit vectors, (N, 3): (N, 2), in the unit of the focal length."""
    with np.errstate(divide='ignore', invalid='ignore'):
        return 2 * focal * rays[:, :2] / (1 + rays[:, 2:])


def shows_the_same(seen: np.ndarray, before: np.ndarray) -> bool:
    """Return whether most of the longest observations, (N, COLUMNS), were there before."""
    one = seen[:LONGEST]
    return bool(_found_again(one, before) >= KNOWN * len(one))


@compiled
def _found_again(seen: np.ndarray, before: np.ndarray) -> int:
    """Return how many observations are near one of others."""
    count = 0
    for i in range(len(seen)):
        for j in range(len(before)):
            if (abs(seen[i, X] - before[j, X]) < NEAR and abs(seen[i, Y] - before[j, Y]) < NEAR
                    and abs(seen[i, NORMAL_X] * before[j, NORMAL_Y]
                            - seen[i, NORMAL_Y] * before[j, NORMAL_X]) < PARALLEL):
                count += 1
                break
    return count
