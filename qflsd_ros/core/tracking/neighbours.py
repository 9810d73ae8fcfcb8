"""
The neighbours of an arc: the tracks that it lies on, found by a grid of tracks.

Tracks are entered one by one into square cells.  An arc is compared with the tracks of the cells
that it crosses, at points along it; each point belongs to the closest track parallel to the arc.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.suppression import PARALLEL
from qflsd_ros.core.tracking import curve
from qflsd_ros.core.tracking.state import MOST

NOBODY = -1         # owner of a point that lies on no track
CELL = 16.0         # px, of the grid: influences the time alone
ENTRIES = 2         # entries of a track into the grid per cell length; chosen, not tuned
EVERY = 3.0         # px between the points of an arc; chosen, not tuned
POINTS = 1024       # of an arc, at most: on longer arcs they are farther apart
ROOM = 2 ** 17      # entries: for tracks of a million px in all


class Grid(NamedTuple):
    """The tracks that have been entered, by place and by number, and the points of one arc."""

    heads: np.ndarray       # (rows, columns) int64: first entry of each cell, or -1
    entries: np.ndarray     # (ROOM, 2) int64: track, and the next entry of the cell, or -1
    counts: np.ndarray      # (2,) int64: entries in use, and arcs compared
    curves: np.ndarray      # (MOST, curve.NUMBERS) float64, the curve of each track
    visits: np.ndarray      # (MOST,) int64, the number of the last arc compared with each
    points: np.ndarray      # (POINTS, 4) float64, points of an arc, px, and its normals there
    owners: np.ndarray      # (POINTS,) int64, the track on which each lies, or NOBODY
    offsets: np.ndarray     # (POINTS,) float64, its distance from that track, px
    cosines: np.ndarray     # (POINTS,) float64, of the angle between both normals


def empty(shape: tuple[int, int]) -> Grid:
    """Return a grid for images of a shape (height, width)."""
    height, width = shape
    return Grid(np.empty((int(height / CELL) + 1, int(width / CELL) + 1), np.int64),
                np.empty((ROOM, 2), np.int64), np.zeros(2, np.int64),
                np.empty((MOST, curve.NUMBERS)), np.zeros(MOST, np.int64),
                np.empty((POINTS, 4)), np.empty(POINTS, np.int64), np.empty(POINTS),
                np.empty(POINTS))


@inlined
def clear(grid: Grid) -> None:
    """Remove all tracks."""
    grid.heads[:] = -1
    grid.counts[0] = 0


@inlined
def _cell(coordinate: float, cells: int) -> int:
    """Return the row or column of cells that holds a coordinate in px, or the closest one."""
    return min(max(int(coordinate / CELL), 0), cells - 1)


@inlined
def _push(grid: Grid, x: float, y: float, track: int) -> None:
    """Enter a track into the cell at a place, px, unless it was the last one entered there."""
    rows, columns = grid.heads.shape
    row, column = _cell(y, rows), _cell(x, columns)
    head, count = grid.heads[row, column], grid.counts[0]
    if count < ROOM and (head < 0 or grid.entries[head, 0] != track):
        grid.entries[count, 0], grid.entries[count, 1] = track, head
        grid.heads[row, column] = count
        grid.counts[0] = count + 1


@compiled
def enter(grid: Grid, rows: np.ndarray, i: int, reach: float) -> None:
    """Enter track i into all cells within ``reach`` px of it."""
    arc = curve.curve(rows, i)
    grid.curves[i] = arc
    steps = int(math.ceil(ENTRIES * curve.length(arc) / CELL))
    sides = max(1, int(math.ceil(2 * reach / CELL)))
    for j in range(steps + 1):
        x, y, nx, ny = curve.at(arc, 2 * j / max(steps, 1) - 1)
        for k in range(sides + 1):
            side = reach * (2 * k / sides - 1)
            _push(grid, x + side * nx, y + side * ny, i)


@inlined
def _along(arc: curve.Curve, x: float, y: float) -> float:
    """Return a point's position along the chord of an arc, from 0 at its start to 1 at its end."""
    ox, oy, ux, uy, half, _, _ = arc
    return 0.5 + 0.5 * ((x - ox) * ux + (y - oy) * uy) / half


@inlined
def _touch(grid: Grid, arc: curve.Curve, steps: int, track: int, distance: float) -> None:
    """Give a track those points of an arc to which it is the closest so far."""
    c = grid.curves[track]
    other = c[0], c[1], c[2], c[3], c[4], c[5], c[6]
    bends = abs(arc[4] * arc[6]) + abs(other[4] * other[6])
    if abs(arc[2] * other[3] - arc[3] * other[2]) > PARALLEL + bends:
        return
    dx, dy = other[4] * other[2], other[4] * other[3]
    a = _along(arc, other[0] - dx, other[1] - dy)
    b = _along(arc, other[0] + dx, other[1] + dy)
    first = int(max(min(a, b) * steps - 1, 0.0))
    last = int(min(max(a, b) * steps + 2, steps + 0.5))
    for j in range(first, last + 1):
        point = grid.points[j]
        share, off, mx, my = curve.beside(other, point[0], point[1])
        if (abs(share) <= 1 and abs(off) <= distance and abs(off) < grid.offsets[j]
                and abs(point[2] * my - point[3] * mx) <= PARALLEL):
            grid.owners[j], grid.offsets[j] = track, abs(off)
            grid.cosines[j] = point[2] * mx + point[3] * my


@inlined
def compare(grid: Grid, arc: curve.Curve, distance: float) -> int:
    """
    Find the tracks within ``distance`` px on which the points of an arc lie.

    Returns
    -------
    The number of points, which are evenly spaced from start to end.  Of each the grid has, after
    the call, the closest parallel track in ``owners``, and in ``cosines`` the cosine between the
    normals: below 0 if their brighter sides are opposite.

    """
    steps = int(min(max(math.ceil(curve.length(arc) / EVERY), 1.0), POINTS - 1.0))
    for j in range(steps + 1):
        grid.points[j] = curve.at(arc, 2 * j / steps - 1)
        grid.owners[j], grid.offsets[j], grid.cosines[j] = NOBODY, np.inf, 0.0
    grid.counts[1] += 1
    number, last = grid.counts[1], -1
    rows, columns = grid.heads.shape
    for j in range(steps + 1):
        row, column = _cell(grid.points[j, 1], rows), _cell(grid.points[j, 0], columns)
        if row * columns + column == last:
            continue
        last = row * columns + column
        entry = grid.heads[row, column]
        while entry >= 0:
            track = grid.entries[entry, 0]
            if grid.visits[track] != number:
                grid.visits[track] = number
                _touch(grid, arc, steps, track, distance)
            entry = grid.entries[entry, 1]
    return steps + 1
