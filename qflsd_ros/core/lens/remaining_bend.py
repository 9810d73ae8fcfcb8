"""
The bend that arcs of straight edges keep after undistortion by a calibration.

The calibrated camera says how the image of the straight edge through the ends of an arc bends.
The difference to the curvature of the edge points is the remaining bend, given as the sagitta of
the arc: its greatest distance from that image, px.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.averaging import Average
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.lens.estimation import straightness
from qflsd_ros.core.lens.observation import CURVATURE, NORMAL, observe, VARIANCE

# Length from which on an arc counts, half diagonals: the same error of a lens bends a shorter one
# by less than a tenth as much as one across the image.  Least number of such arcs in a frame.
LONG, LEAST = 0.35, 8
# Longest arcs of a frame that count.
USED = 60
# Probability from which on an arc counts as the image of a straight edge.
STRAIGHT = 0.5
# Distance for the derivative of a viewing direction, px.
STEP = 1e-2
# Multiple of the scatter from which on a bend is an outlier: 1 in 700 of normal ones.
OUTLIER, TO_DEVIATION = 3.2, 1.4826      # deviation of a normal distribution over its median
# Frames of which one is evaluated, since neighbours resemble each other; and evaluated frames
# after which one counts 1 / e, some seconds: a calibration that has just been replaced.
EVERY, MEMORY = 5, 20


class Bend(NamedTuple):
    """
    What a calibration leaves of the bend.

    Attributes
    ----------
    rms
        Root mean square sagitta of the arcs beyond their own errors, px.
    std
        Its standard deviation, px.
    share
        Share of the long arcs that are taken for images of straight edges.

    """

    rms: float
    std: float
    share: float


def remaining_bend(arcs: Arcs, shape: tuple[int, int], lens: DivisionModel | None,
                   camera: CameraModel) -> Bend | None:
    """
    Return the bend that a calibration leaves of the arcs of one image; None with too few.

    Parameters
    ----------
    arcs, shape
        The arcs of the image, and its (height, width).
    lens
        The lens as the arcs show it, which tells images of straight edges; None if it is unknown,
        then all long arcs count that are not outliers.
    camera
        The calibration.

    """
    unit = math.hypot(*shape) / 2
    long = np.flatnonzero(arcs.table['length'] > LONG * unit)
    count = len(long)
    if lens is not None:
        long = long[straightness(arcs, lens)[long] > STRAIGHT]
    long = long[np.argsort(-arcs.table['length'][long], kind='stable')][:USED]
    bend, variance = _bends(arcs, long, shape, camera)
    known = np.isfinite(bend + variance)
    # A part of the image that the calibration does not describe cannot be undistorted by it.
    bend, variance = bend[known], variance[known]
    if len(bend) < LEAST:
        return None
    near = np.abs(bend) < OUTLIER * TO_DEVIATION * np.median(np.abs(bend))
    bend, variance = bend[near], variance[near]
    excess = bend ** 2 - variance
    square = max(float(excess.mean()), 0.0)
    # The scatter of squares; noise alone has sqrt(2) of its variance.
    error = math.sqrt(excess.var() / len(excess)) / (2 * math.sqrt(max(square, variance.mean())))
    return Bend(math.sqrt(square), error, len(bend) / count)


def _bends(arcs: Arcs, chosen: np.ndarray, shape: tuple[int, int], camera: CameraModel
           ) -> tuple[np.ndarray, np.ndarray]:
    """Return the remaining sagittas of some arcs and their variances: (N,) px, px^2."""
    table, unit = arcs.table[chosen], math.hypot(*shape) / 2
    seen = observe(arcs, shape)[chosen]
    normal = seen[:, NORMAL:NORMAL + 2]
    chord = table['end'] - table['start']
    across = np.stack([-chord[:, 1], chord[:, 0]], axis=1) / np.hypot(*chord.T)[:, None]
    square = table['length'] ** 2 / 8
    sign = np.where((normal * across).sum(axis=1) < 0, -1, 1)
    # The curvature is positive where the arc bends away from its normal, so that its middle lies
    # on the side of the normal.
    found = sign * seen[:, CURVATURE] / unit * square
    wanted = _sagitta(table['start'], table['end'], across, found, camera)
    return found - wanted, seen[:, VARIANCE] / unit ** 2 * square ** 2


def _sagitta(start: np.ndarray, end: np.ndarray, across: np.ndarray, near: np.ndarray,
             camera: CameraModel) -> np.ndarray:
    """Return how far the images of straight edges pass beside the middles of their chords."""
    plane = np.cross(camera.rays(start), camera.rays(end))
    middle = (start + end) / 2 + near[:, None] * across
    here, beside = ((camera.rays(middle + step * across) * plane).sum(axis=1)
                    for step in (0.0, STEP))
    with np.errstate(divide='ignore', invalid='ignore'):
        return near - here * STEP / (beside - here)


class CalibrationWatch:
    """
    Watches over successive frames how straight a calibration makes the arcs of straight edges.

    Attributes
    ----------
    bend
        The remaining bend over the last seconds; None until a frame has enough long arcs.

    """

    def __init__(self) -> None:
        self.bend: Bend | None = None
        self._camera: CameraModel | None = None
        self._frames = 0
        self._mean = Average(1, MEMORY)

    def add(self, arcs: Arcs, shape: tuple[int, int], lens: DivisionModel | None,
            camera: CameraModel) -> None:
        """Take the next frame; arguments are those of :func:`remaining_bend`."""
        if self._camera is None or not _same(camera, self._camera):
            self.__init__()     # type: ignore[misc]
            self._camera = camera
        self._frames += 1
        if self._frames % EVERY != 1:
            return
        found = remaining_bend(arcs, shape, lens, camera)
        if found is None:
            return
        self._mean.add(np.array([found.rms]), np.array([found.std]))
        self.bend = Bend(float(self._mean.mean[0]), float(self._mean.deviations()[0]),
                         found.share)


def _same(camera: CameraModel, other: CameraModel) -> bool:
    return (camera.model == other.model and np.array_equal(camera.matrix, other.matrix)
            and np.array_equal(camera.coefficients, other.coefficients))
