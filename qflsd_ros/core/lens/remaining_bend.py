"""
The bend that arcs of straight edges keep after undistortion by a calibration.

The calibrated camera says how the image of the straight edge through the ends of an arc bends.
The difference to the curvature of the edge points is the remaining bend, given as the sagitta of
the arc: its greatest distance from that image, px.  Squares of it are averaged over the length of
edges, since a wrong calibration bends long arcs most, and over the inverse of their variance.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.lens.observation import CURVATURE, NORMAL, observe, VARIANCE
from qflsd_ros.core.lens.straightness import excess_bend

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
    The bend that a calibration leaves.

    Attributes
    ----------
    rms
        Root mean square sagitta of the arcs beyond their own errors, px.
    std
        Its standard deviation by the errors of the arcs, px.
    share
        Share of the long arcs that are taken for images of straight edges.

    """

    rms: float
    std: float
    share: float


class _Squares(NamedTuple):
    """Mean square sagitta, px^2, the variance of that mean, its weight, and the share of arcs."""

    mean: float
    variance: float
    weight: float
    share: float

    def bend(self) -> Bend:
        """Return the root."""
        rms, least = math.sqrt(max(self.mean, 0.0)), self.variance ** 0.25
        return Bend(rms, math.sqrt(self.variance) / (2 * max(rms, least)), self.share)


def remaining_bend(arcs: Arcs, shape: tuple[int, int], lens: DivisionModel | None,
                   camera: CameraModel) -> Bend | None:
    """
    Return the bend that a calibration leaves of the arcs of one image; None with too few.

    Parameters
    ----------
    arcs, shape
        The arcs of the image, and its (height, width).
    lens
        The lens as the arcs show it.  An arc that neither this lens nor the calibration makes
        straight is no image of a straight edge.  None if it is unknown: the calibration decides
        alone, and its own errors hide arcs that it bends more than most.
    camera
        The calibration.

    """
    found = _squares(arcs, shape, lens, camera)
    return found and found.bend()


def _squares(arcs: Arcs, shape: tuple[int, int], lens: DivisionModel | None, camera: CameraModel
             ) -> _Squares | None:
    """Return the mean square of the remaining bend; arguments are those above."""
    length = arcs.table['length']
    long = np.flatnonzero(length > LONG * math.hypot(*shape) / 2)
    count = len(long)
    long = long[np.argsort(-length[long], kind='stable')]
    if lens is None:
        chosen = long[:USED]
        bend, variance = _bends(arcs, chosen, shape, camera)
        least = np.abs(bend)
    else:
        curvature, straight = excess_bend(arcs, lens)
        chosen = long[straight[long] > STRAIGHT][:USED]
        bend, variance = _bends(arcs, chosen, shape, camera)
        least = np.minimum(np.abs(bend), np.abs(curvature[chosen]) * length[chosen] ** 2 / 8)
    # A part of the image that the calibration does not describe cannot be undistorted by it.
    known = np.isfinite(bend + variance)
    if np.count_nonzero(known) < LEAST:
        return None
    off = least / np.sqrt(variance)
    near = known & (off < OUTLIER * TO_DEVIATION * np.median(off[known]))
    bend, variance = bend[near], variance[near]
    weight = length[chosen[near]] / variance
    total, square = weight.sum(), bend ** 2
    # Of the square of a normally distributed bend.
    noise = 2 * variance ** 2 + 4 * square * variance
    return _Squares(float(weight @ (square - variance) / total),
                    float(weight ** 2 @ noise / total ** 2), float(total), len(bend) / count)


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


class BendTracker:
    """
    Follows the remaining bend over successive frames.

    Attributes
    ----------
    bend
        That of the last seconds; None until a frame has enough long arcs.

    """

    def __init__(self) -> None:
        self._camera: CameraModel | None = None
        self._forget()

    def _forget(self) -> None:
        """Begin anew."""
        self.bend: Bend | None = None
        self._frames = 0
        self._mean: _Squares | None = None

    def add(self, arcs: Arcs, shape: tuple[int, int], lens: DivisionModel | None,
            camera: CameraModel) -> None:
        """
        Take the next frame; all begins anew with another calibration.

        Arguments are those of :func:`remaining_bend`.
        """
        if self._camera is None or not _same(camera, self._camera):
            self._camera = camera
            self._forget()
        self._frames += 1
        if self._frames % EVERY != 1:
            return
        found = _squares(arcs, shape, lens, camera)
        if found is not None:
            self._mean = _averaged(self._mean, found)
            self.bend = self._mean.bend()


def _averaged(before: _Squares | None, now: _Squares) -> _Squares:
    """
    Return the mean of successive frames with an exponential memory.

    The variance is that of a single frame, because neighbouring frames show the same edges.
    """
    if before is None:
        return now
    weight = (1 - 1 / MEMORY) * before.weight + now.weight
    share = now.weight / weight
    return _Squares(before.mean + share * (now.mean - before.mean),
                    before.variance + share * (now.variance - before.variance),
                    weight, now.share)


def _same(camera: CameraModel, other: CameraModel) -> bool:
    return (camera.model == other.model and np.array_equal(camera.matrix, other.matrix)
            and np.array_equal(camera.coefficients, other.coefficients))
