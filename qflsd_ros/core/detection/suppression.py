"""
Of parallel arcs that lie on top of each other, the longest.

A thin line in the image has two edges, one on either side; a blurred or double edge may be found
twice; sharpening draws a faint edge beside a strong one, some px farther off.  Arcs are entered
into a grid, the longest first; one that for the most part lies beside those in it, in the same
direction, is left out.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.arcs import CONTRAST, END, LENGTH, MIDDLE, START
from qflsd_ros.core.compilation import compiled, inlined

PARALLEL = math.sin(math.radians(10.0))
HIDDEN = 0.6        # share of an arc beside others from which on it is left out
FAINT = 0.55        # of a strong arc's contrast: what may be the halo that sharpening gives it
HALO = 1.5          # how many times as far as others such a halo is looked for
CELL = 16.0         # px, of the grid
ENTRIES = 2         # of an arc to the grid for each length of a cell
STEP = 6.0          # px between the places of an arc that are looked at


@inlined
def _near(fits: np.ndarray, arc: int, x: float, y: float) -> tuple[float, float, float]:
    """Return P(x, y) of an arc, and its gradient: about the distance, and the unit normal."""
    a, b, c = fits[arc, 2], fits[arc, 3], fits[arc, 4]
    x, y = x - fits[arc, 0], y - fits[arc, 1]
    return a * (x * x + y * y) + b * x + c * y + fits[arc, 5], 2 * a * x + b, 2 * a * y + c


@inlined
def _at(rows: np.ndarray, fits: np.ndarray, arc: int,
        share: float) -> tuple[float, float, float, float]:
    """Return a point of an arc, about the given share along it, and the unit normal there."""
    a, b, c = (1 - share) * (1 - 2 * share), 4 * share * (1 - share), share * (2 * share - 1)
    x = a * rows[arc, START] + b * rows[arc, MIDDLE] + c * rows[arc, END]
    y = a * rows[arc, START + 1] + b * rows[arc, MIDDLE + 1] + c * rows[arc, END + 1]
    p, nx, ny = _near(fits, arc, x, y)
    return x - p * nx, y - p * ny, nx, ny


@inlined
def _beside(rows: np.ndarray, fits: np.ndarray, arc: int, x: float, y: float, nx: float,
            ny: float, distance: float) -> bool:
    """Return whether an arc passes a point within the distance, at right angles to (nx, ny)."""
    p, ux, uy = _near(fits, arc, x, y)
    if abs(p) > distance or abs(nx * uy - ny * ux) > PARALLEL:
        return False
    x0, y0 = rows[arc, START], rows[arc, START + 1]
    cx, cy = rows[arc, END] - x0, rows[arc, END + 1] - y0
    along = (x - x0) * cx + (y - y0) * cy
    return 0 <= along <= cx * cx + cy * cy


@inlined
def _reach(rows: np.ndarray, arc: int, other: int, distance: float) -> float:
    """Return up to which distance from another arc one is left out."""
    faint = rows[arc, CONTRAST] < FAINT * rows[other, CONTRAST]
    return HALO * distance if faint else distance


@compiled
def _hidden(rows: np.ndarray, fits: np.ndarray, arc: int, heads: np.ndarray, entries: np.ndarray,
            distance: float) -> bool:
    """Return whether an arc for the most part lies beside those in the grid."""
    steps = int(math.ceil(rows[arc, LENGTH] / STEP))
    free = (1 - HIDDEN) * (steps + 1)
    for i in range(steps + 1):
        x, y, nx, ny = _at(rows, fits, arc, i / steps)
        row = min(max(int(y / CELL), 0), heads.shape[0] - 1)
        column = min(max(int(x / CELL), 0), heads.shape[1] - 1)
        entry = heads[row, column]
        while entry >= 0 and not _beside(rows, fits, entries[entry, 0], x, y, nx, ny,
                                         _reach(rows, arc, entries[entry, 0], distance)):
            entry = entries[entry, 1]
        if entry < 0:
            free -= 1
            if free < 0:
                return False
    return True


@compiled
def _sides(distance: float) -> int:
    """Return how many steps across an arc, a cell long at most, cover its reach."""
    return max(1, math.ceil(2 * HALO * distance / CELL))


@compiled
def _enter(rows: np.ndarray, fits: np.ndarray, arc: int, distance: float, heads: np.ndarray,
           entries: np.ndarray, count: int) -> int:
    """Enter an arc into all cells within reach of it; return the new count."""
    sides = _sides(distance)
    steps = int(math.ceil(ENTRIES * rows[arc, LENGTH] / CELL))
    for i in range(steps + 1):
        x, y, nx, ny = _at(rows, fits, arc, i / steps)
        for j in range(sides + 1):
            side = HALO * distance * (2 * j / sides - 1)
            row = min(max(int((y + side * ny) / CELL), 0), heads.shape[0] - 1)
            column = min(max(int((x + side * nx) / CELL), 0), heads.shape[1] - 1)
            head = heads[row, column]
            if head < 0 or entries[head, 0] != arc:
                entries[count, 0], entries[count, 1] = arc, head
                heads[row, column] = count
                count += 1
    return count


@compiled
def _separate(rows: np.ndarray, fits: np.ndarray, order: np.ndarray, distance: float,
              heads: np.ndarray, entries: np.ndarray, keep: np.ndarray) -> None:
    count = 0
    for arc in order:
        keep[arc] = not _hidden(rows, fits, arc, heads, entries, distance)
        if keep[arc]:
            count = _enter(rows, fits, arc, distance, heads, entries, count)


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
        Largest distance at which an arc is beside another, px, above 0; HALO times as much where
        it is faint.
    keep
        (M,) bool, set to False where an arc is left out; those for which it is False already are
        not looked at.

    """
    lengths, order = rows[:, LENGTH], np.flatnonzero(keep)
    # Exactly the longest first: so leaving out the shortest beforehand changes nothing for others.
    order = order[np.argsort(-lengths[order], kind='stable')]
    heads = np.full((int(height / CELL) + 1, int(width / CELL) + 1), -1, np.int64)
    most = (_sides(distance) + 1) * int(ENTRIES / CELL * lengths[order].sum() + 2 * len(order))
    _separate(rows, fits, order, distance, heads, np.empty((most, 2), np.int64), keep)
