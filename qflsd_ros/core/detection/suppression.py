"""
Suppression: of parallel arcs closer than min_distance, the longest is kept.

A blurred edge may be found twice, and sharpening in the camera adds a faint edge, a halo, beside
a strong one.  Both sides of a thin line are edges of opposite polarity and are kept: a choice
between them would change from frame to frame.

Arcs are entered into a grid, the longest first.  An arc is suppressed if most of it is close and
parallel to arcs in the grid.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.arcs import CONTRAST, END, LENGTH, MIDDLE, START
from qflsd_ros.core.compilation import compiled, inlined

# All of these are chosen, not tuned, unless stated otherwise.
PARALLEL = math.sin(math.radians(10.0))     # sine of the angle between parallel arcs, at most
HIDDEN = 0.6        # share of an arc close to others from which on it is suppressed
FAINT = 0.55        # contrast of a halo, as a share of the contrast of the arc, at most
# Distance of an arc of opposite polarity, as a multiple of min_distance, at most: the sides of a
# line of no width that is blurred by s are 2 s apart, 1.9 px with the usual blur and Sobel.
OPPOSITE = 0.5
HALO = 1.5          # distance of a halo, as a multiple of min_distance, at most
CELL = 16.0         # px, of the grid
ENTRIES = 2         # entries of an arc into the grid per cell length
STEP = 6.0          # px between the points of an arc that are compared


class Grid(NamedTuple):
    """The arcs near each cell, as linked lists."""

    heads: np.ndarray       # (rows, columns) int64: first entry of each cell, or -1
    entries: np.ndarray     # (E, 2) int64: arc, and the next entry of the cell, or -1


@inlined
def _at(rows: np.ndarray, fits: np.ndarray, arc: int,
        share: float) -> tuple[float, float, float, float]:
    """Return the point of an arc at about the given share of its length, and the unit normal."""
    a, b, c = (1 - share) * (1 - 2 * share), 4 * share * (1 - share), share * (2 * share - 1)
    x = a * rows[arc, START] + b * rows[arc, MIDDLE] + c * rows[arc, END]
    y = a * rows[arc, START + 1] + b * rows[arc, MIDDLE + 1] + c * rows[arc, END + 1]
    p = circle.value_at(fits, arc, x, y)
    nx, ny = circle.normal_at(fits, arc, x, y)
    return x - p * nx, y - p * ny, nx, ny


@inlined
def _is_beside(rows: np.ndarray, fits: np.ndarray, arc: int,
               point: tuple[float, float, float, float], distance: float) -> bool:
    """Return whether an arc passes a point (x, y, unit normal) in parallel within a distance."""
    x, y, nx, ny = point
    p = circle.value_at(fits, arc, x, y)
    ux, uy = circle.normal_at(fits, arc, x, y)
    if abs(p) > distance or abs(nx * uy - ny * ux) > PARALLEL:
        return False
    x0, y0 = rows[arc, START], rows[arc, START + 1]
    cx, cy = rows[arc, END] - x0, rows[arc, END + 1] - y0
    along = (x - x0) * cx + (y - y0) * cy
    return 0 <= along <= cx * cx + cy * cy


@inlined
def _reach(rows: np.ndarray, arc: int, other: int, distance: float) -> float:
    """Return the distance from another arc within which an arc is suppressed."""
    if rows[arc, CONTRAST] < FAINT * rows[other, CONTRAST]:
        return HALO * distance
    along = ((rows[arc, END] - rows[arc, START]) * (rows[other, END] - rows[other, START])
             + (rows[arc, END + 1] - rows[arc, START + 1])
             * (rows[other, END + 1] - rows[other, START + 1]))
    return distance if along > 0 else OPPOSITE * distance


@inlined
def _cell(coordinate: float, cells: int) -> int:
    return min(max(int(coordinate / CELL), 0), cells - 1)


@compiled
def _is_hidden(rows: np.ndarray, fits: np.ndarray, arc: int, grid: Grid, distance: float) -> bool:
    """Return whether most of an arc is close and parallel to arcs in the grid."""
    heads, entries = grid
    steps = int(math.ceil(rows[arc, LENGTH] / STEP))
    free = (1 - HIDDEN) * (steps + 1)
    for i in range(steps + 1):
        point = _at(rows, fits, arc, i / steps)
        entry = heads[_cell(point[1], heads.shape[0]), _cell(point[0], heads.shape[1])]
        while entry >= 0 and not _is_beside(rows, fits, entries[entry, 0], point,
                                            _reach(rows, arc, entries[entry, 0], distance)):
            entry = entries[entry, 1]
        if entry < 0:
            free -= 1
            if free < 0:
                return False
    return True


@compiled
def _sides(distance: float) -> int:
    """Return the number of steps, each a cell at most, that cover the reach across an arc."""
    return max(1, math.ceil(2 * HALO * distance / CELL))


@compiled
def _enter(rows: np.ndarray, fits: np.ndarray, arc: int, distance: float, grid: Grid,
           count: int) -> int:
    """Enter an arc into all cells within its reach; return the new number of entries."""
    heads, entries = grid
    sides = _sides(distance)
    steps = int(math.ceil(ENTRIES * rows[arc, LENGTH] / CELL))
    for i in range(steps + 1):
        x, y, nx, ny = _at(rows, fits, arc, i / steps)
        for j in range(sides + 1):
            side = HALO * distance * (2 * j / sides - 1)
            row, column = _cell(y + side * ny, heads.shape[0]), _cell(x + side * nx,
                                                                      heads.shape[1])
            head = heads[row, column]
            if head < 0 or entries[head, 0] != arc:
                entries[count, 0], entries[count, 1] = arc, head
                heads[row, column] = count
                count += 1
    return count


@compiled
def _suppress(rows: np.ndarray, fits: np.ndarray, order: np.ndarray, distance: float, grid: Grid,
              keep: np.ndarray) -> None:
    count = 0
    for arc in order:
        keep[arc] = not _is_hidden(rows, fits, arc, grid, distance)
        if keep[arc]:
            count = _enter(rows, fits, arc, distance, grid, count)


def suppress(rows: np.ndarray, fits: np.ndarray, shape: tuple[int, int], distance: float,
             keep: np.ndarray) -> None:
    """
    Suppress arcs that are close and parallel to longer ones.

    Parameters
    ----------
    rows, fits
        (M, COLUMNS) and (M, FIT_SIZE) float64, the arcs as in :mod:`assembly`.
    shape
        Height and width of the image, px.
    distance
        Largest distance of a suppressed arc, px, above 0; HALO times as much if it is faint.
    keep
        (M,) bool, set to False for suppressed arcs; arcs for which it is False already are
        ignored.

    """
    lengths, order = rows[:, LENGTH], np.flatnonzero(keep)
    # In exact order of length, so that an arc depends on longer arcs alone.
    order = order[np.argsort(-lengths[order], kind='stable')]
    heads = np.full([int(side / CELL) + 1 for side in shape], -1, np.int64)
    most = (_sides(distance) + 1) * int(ENTRIES / CELL * lengths[order].sum() + 2 * len(order))
    _suppress(rows, fits, order, distance, Grid(heads, np.empty((most, 2), np.int64)), keep)
