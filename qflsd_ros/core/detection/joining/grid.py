"""
The grid of ends: a spatial index for the search of ends near the tangent at another end.

The ends of pieces are sorted into square cells, row by row, so that the ends in neighbouring cells
of one row are contiguous in memory.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined

# All of these are chosen, not tuned, unless stated otherwise.
CELL = 16.0             # px, side of a cell: influences the time alone
COSINE = math.cos(math.radians(9.0))        # least, of the angle between the tangents at a gap
OVERLAP = 4.0           # px by which two pieces may overlap
ACROSS = 1.2            # px, largest distance of an end from the tangent at the other end
ACROSS_SLOPE = 0.18     # px by which that distance grows for each px of gap


class Grid(NamedTuple):
    """M ends in ``rows`` times ``columns`` cells."""

    begins: np.ndarray      # (rows columns + 1,) int64: index in order of each cell's first end
    order: np.ndarray       # (M,) int64: the ends (2 piece + side), sorted by cell
    places: np.ndarray      # (M, 4) float64: x, y and outward unit tangent of these ends
    columns: int
    rows: int


@inlined
def cell(coordinate: float, cells: int) -> int:
    """Return the row or column of cells, 0 to ``cells`` - 1, that holds a coordinate in px."""
    return min(max(int(coordinate / CELL), 0), cells - 1)


@inlined
def _cell_of(ends: np.ndarray, e: int, grid: Grid) -> int:
    """Return the number of the cell that holds an end; cells are numbered row by row."""
    return cell(ends[e, 1], grid.rows) * grid.columns + cell(ends[e, 0], grid.columns)


@compiled
def _sort(ends: np.ndarray, grid: Grid, filled: np.ndarray) -> None:
    """
    Fill the arrays of a grid by a counting sort.

    ``grid.begins`` is 0 before; ``filled`` is scratch of the same size: the next free place of
    each cell in ``grid.order``.
    """
    begins = grid.begins
    for e in range(len(grid.order)):
        begins[_cell_of(ends, e, grid) + 1] += 1
    for k in range(grid.rows * grid.columns):
        begins[k + 1] += begins[k]
        filled[k] = begins[k]
    for e in range(len(grid.order)):
        at = _cell_of(ends, e, grid)
        k = filled[at]
        filled[at] += 1
        grid.order[k] = e
        for column in range(4):
            grid.places[k, column] = ends[e, column]


def sort_ends(ends: np.ndarray, order: np.ndarray, places: np.ndarray, height: int,
              width: int) -> Grid:
    """
    Sort ends into cells.

    Parameters
    ----------
    ends
        (M, 4) float64, position and outward unit tangent.
    order, places
        Memory for those of the grid, of the same sizes.
    height, width
        Of the image, px.

    """
    columns, rows = int(width / CELL) + 1, int(height / CELL) + 1
    begins, filled = np.zeros((2, columns * rows + 1), np.int64)
    grid = Grid(begins, order, places, columns, rows)
    _sort(ends, grid, filled)
    return grid


@inlined
def gap_to(tip: tuple[float, float, float, float], grid: Grid, k: int, longest: float) -> float:
    """Return the gap, px, from a tip (x, y, tangent) to end k, or inf if k is not in line."""
    x, y, tx, ty = tip
    gx, gy = grid.places[k, 0] - x, grid.places[k, 1] - y
    along, across = gx * tx + gy * ty, gx * ty - gy * tx
    # One branch for all tests, since most ends fail, each in another test: more branches would be
    # mispredicted.
    within = (along >= -OVERLAP) & (along <= longest)
    beside = abs(across) <= ACROSS + ACROSS_SLOPE * abs(along)
    if within & beside & (tx * grid.places[k, 2] + ty * grid.places[k, 3] <= -COSINE):
        return math.sqrt(gx * gx + gy * gy)
    return np.inf
