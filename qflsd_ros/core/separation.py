"""
Of parallel arcs that lie on top of each other, the longest.

A thin line in the image has two edges, one on either side; a blurred or double edge may be found
twice.  Arcs are painted into a map, the longest first; one that would lie for the most part beside
what is painted already, in the same direction, is left out.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.circle import compiled, inlined

PARALLEL = math.cos(math.radians(10.0))
STEP = 2.0          # px between the places that are looked at
HIDDEN = 0.5        # share of an arc beside others from which on it is left out


@inlined
def _normal(fits: np.ndarray, arc: int, x: float, y: float) -> tuple[float, float]:
    """Return the gradient of P at a point: the unit normal, where the point is on the curve."""
    return (2 * fits[arc, 2] * (x - fits[arc, 0]) + fits[arc, 3],
            2 * fits[arc, 2] * (y - fits[arc, 1]) + fits[arc, 4])


@inlined
def _at(rows: np.ndarray, arc: int, share: float) -> tuple[float, float]:
    """Return a point of an arc, close to the given share of its length, by a parabola."""
    a, b, c = (1 - share) * (1 - 2 * share), 4 * share * (1 - share), share * (2 * share - 1)
    return (a * rows[arc, 0] + b * rows[arc, 2] + c * rows[arc, 4],
            a * rows[arc, 1] + b * rows[arc, 3] + c * rows[arc, 5])


@compiled
def _paint(rows: np.ndarray, arc: int, owners: np.ndarray, colour: int) -> None:
    """Set the map to ``colour`` in the pixels along an arc."""
    height, width = owners.shape
    steps = max(1, int(math.ceil(rows[arc, 7])))
    for i in range(steps + 1):
        x, y = _at(rows, arc, i / steps)
        column, row = int(x + 0.5), int(y + 0.5)
        if 0 <= row < height and 0 <= column < width:
            owners[row, column] = colour


@compiled
def _hidden(rows: np.ndarray, fits: np.ndarray, arc: int, owners: np.ndarray,
            distance: float) -> float:
    """Return the share of an arc that lies beside painted ones."""
    height, width = owners.shape
    steps = max(1, int(math.ceil(rows[arc, 7] / STEP)))
    reach, covered = int(math.ceil(distance)), 0
    for i in range(steps + 1):
        x, y = _at(rows, arc, i / steps)
        nx, ny = _normal(fits, arc, x, y)
        for k in range(-reach, reach + 1):
            offset = distance * k / reach
            column, row = int(x + offset * nx + 0.5), int(y + offset * ny + 0.5)
            if 0 <= row < height and 0 <= column < width and owners[row, column] > 0:
                mx, my = _normal(fits, owners[row, column] - 1, x, y)
                if abs(nx * mx + ny * my) > PARALLEL:
                    covered += 1
                    break
    return covered / (steps + 1)


@compiled
def separate(rows: np.ndarray, fits: np.ndarray, distance: float, owners: np.ndarray,
             keep: np.ndarray) -> None:
    """
    Leave out arcs that lie within ``distance`` px beside longer ones.

    Parameters
    ----------
    rows, fits
        (M, COLUMNS) and (M, FIT_SIZE) float64, the arcs as in :mod:`assembly`.
    distance
        px; 0 leaves all in.
    owners
        (H, W) int32, all 0, and so again afterwards.
    keep
        (M,) bool, set to False where an arc is left out; arcs for which it is False already are
        not looked at.

    """
    if distance <= 0:
        return
    for arc in np.argsort(-rows[:, 7], kind='mergesort'):
        if keep[arc]:
            keep[arc] = _hidden(rows, fits, arc, owners, distance) < HIDDEN
            if keep[arc]:
                _paint(rows, arc, owners, arc + 1)
    for arc in range(len(rows)):
        if keep[arc]:
            _paint(rows, arc, owners, 0)
