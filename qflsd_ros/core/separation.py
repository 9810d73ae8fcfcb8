"""
Of parallel arcs that lie on top of each other, the longest.

A thin line in the image has two edges, one on either side; a blurred or double edge may be found
twice.  Arcs are entered into a grid, the longest first; one that for the most part lies beside
those in it, in the same direction, is left out.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.compilation import compiled, inlined

PARALLEL = math.cos(math.radians(10.0))
HIDDEN = 0.65       # share of an arc beside others from which on it is left out
CELL = 16.0         # px, of the grid
ENTRIES = 4         # of an arc to the grid for each length of a cell
STEP = 4.0          # px between the places of an arc that are looked at


@inlined
def _at(rows: np.ndarray, fits: np.ndarray, arc: int,
        share: float) -> tuple[float, float, float, float]:
    """Return a point of an arc, about the given share along it, and the unit tangent there."""
    a, b, c = (1 - share) * (1 - 2 * share), 4 * share * (1 - share), share * (2 * share - 1)
    return circle.foot(fits, arc, a * rows[arc, 0] + b * rows[arc, 2] + c * rows[arc, 4],
                       a * rows[arc, 1] + b * rows[arc, 3] + c * rows[arc, 5])


@inlined
def _beside(rows: np.ndarray, fits: np.ndarray, arc: int, x: float, y: float, tx: float,
            ty: float, distance: float) -> bool:
    """Return whether an arc passes a point within the distance, along the tangent (tx, ty)."""
    fx, fy, ux, uy = circle.foot(fits, arc, x, y)
    if ((x - fx) ** 2 + (y - fy) ** 2 > distance * distance
            or abs(tx * ux + ty * uy) < PARALLEL):
        return False
    cx, cy = rows[arc, 4] - rows[arc, 0], rows[arc, 5] - rows[arc, 1]
    along = (x - rows[arc, 0]) * cx + (y - rows[arc, 1]) * cy
    return 0 <= along <= cx * cx + cy * cy


@compiled
def _hidden(rows: np.ndarray, fits: np.ndarray, arc: int, heads: np.ndarray, entries: np.ndarray,
            distance: float) -> float:
    """Return the share of an arc that lies beside those in the grid."""
    steps, covered = int(math.ceil(rows[arc, 7] / STEP)), 0
    for i in range(steps + 1):
        x, y, tx, ty = _at(rows, fits, arc, i / steps)
        row = min(max(int(y / CELL), 0), heads.shape[0] - 1)
        column = min(max(int(x / CELL), 0), heads.shape[1] - 1)
        entry = heads[row, column]
        while entry >= 0:
            if _beside(rows, fits, entries[entry, 0], x, y, tx, ty, distance):
                covered += 1
                break
            entry = entries[entry, 1]
    return covered / (steps + 1)


@compiled
def _enter(rows: np.ndarray, fits: np.ndarray, arc: int, distance: float, heads: np.ndarray,
           entries: np.ndarray, count: int) -> int:
    """Enter an arc into all cells that it passes within the distance; return the new count."""
    steps = int(math.ceil(ENTRIES * rows[arc, 7] / CELL))
    for i in range(steps + 1):
        x, y, tx, ty = _at(rows, fits, arc, i / steps)
        for side in (-distance, distance):
            row = min(max(int((y + side * tx) / CELL), 0), heads.shape[0] - 1)
            column = min(max(int((x - side * ty) / CELL), 0), heads.shape[1] - 1)
            head = heads[row, column]
            if head < 0 or entries[head, 0] != arc:
                entries[count, 0], entries[count, 1] = arc, head
                heads[row, column] = count
                count += 1
    return count


@compiled
def separate(rows: np.ndarray, fits: np.ndarray, height: int, width: int, distance: float,
             keep: np.ndarray) -> None:
    """
    Leave out arcs that lie beside longer ones.

    Parameters
    ----------
    rows, fits
        (M, COLUMNS) and (M, FIT_SIZE) float64, the arcs as in :mod:`assembly`.
    height, width
        Size of the image, px.
    distance
        Largest distance at which an arc is beside another, px, above 0.
    keep
        (M,) bool, set to False where an arc is left out; those for which it is False already are
        not looked at.

    """
    heads = np.full((int(height / CELL) + 1, int(width / CELL) + 1), -1, np.int64)
    most = 0
    for arc in range(len(keep)):
        if keep[arc]:
            most += 2 * (2 + int(math.ceil(ENTRIES * rows[arc, 7] / CELL)))
    entries, count = np.empty((most, 2), np.int64), 0
    for arc in np.argsort(-rows[:, 7], kind='mergesort'):
        if keep[arc]:
            keep[arc] = _hidden(rows, fits, arc, heads, entries, distance) < HIDDEN
            if keep[arc]:
                count = _enter(rows, fits, arc, distance, heads, entries, count)
