"""
Edges along the normals of an arc (moving edges).

P. Bouthemy, A maximum likelihood framework for determining moving edges, PAMI 1989.

A normal is sampled along x or y, whichever is closer to it, at the centres of pixels, so that
gradients need no interpolation.  The maximum is interpolated by the parabola of
:func:`detection.contours.edges.locate`.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import inlined
from qflsd_ros.core.detection.contours.gradients import GAIN
from qflsd_ros.core.detection.frame import Frame

# Largest tangent of the angle between the gradient at an edge and the normal; chosen, not tuned.
TURNED = math.tan(math.radians(30.0))
EDGES = 4               # edges kept on a normal, the closest to the arc; chosen, not tuned

# Least gradient of an edge, grey levels, and whether its sign counts.
Wanted = tuple[float, bool]


@inlined
def in_sight(image: Frame, x: float, y: float) -> bool:
    """Return whether a point lies in the image, 1 px from its border, and near no masked pixel."""
    height, width = image.dx.shape
    if not (1 <= x <= width - 2 and 1 <= y <= height - 2):
        return False
    return not image.region.masked or image.region.seen[int(y + 0.5), int(x + 0.5)]


@inlined
def _across(image: Frame, row: int, column: int, nx: float, ny: float,
            signed: bool) -> float:
    """Return the gradient along a normal, in the units of the image."""
    g = image.dx[row, column] * nx + image.dy[row, column] * ny
    return g if signed else abs(g)


@inlined
def _insert(found: np.ndarray, strength: np.ndarray, count: int, off: float,
            g: float) -> int:
    """Insert an edge into those of a normal, the closest first; return the new count."""
    k = count
    if count == EDGES:
        if abs(found[EDGES - 1]) <= abs(off):
            return count
        k = EDGES - 1
    while k > 0 and abs(found[k - 1]) > abs(off):
        found[k], strength[k] = found[k - 1], strength[k - 1]
        k -= 1
    found[k], strength[k] = off, g
    return min(count + 1, EDGES)


@inlined
def edges_along(image: Frame, ray: tuple[float, float, float, float], reach: float,
                wanted: Wanted, found: np.ndarray, strength: np.ndarray) -> int:
    """
    Find the edges along a normal.

    Parameters
    ----------
    image
        The frame.
    ray
        A point, px, and the unit normal there.
    reach
        Length of the normal on either side, px.
    wanted
        Least gradient along the normal, grey levels; and whether only edges count whose brighter
        side is ahead along the normal.
    found, strength
        (EDGES,) float64, receive the distances of the edges along the normal, px, the closest
        first, and their gradients along it, grey levels.

    Returns
    -------
    Number of edges.

    """
    (x, y, nx, ny), (least, signed) = ray, wanted
    height, width = image.dx.shape
    across_x = abs(nx) >= abs(ny)
    if across_x:
        fixed = int(y + 0.5)
        centre, per, size, lines = x - (fixed - y) * ny / nx, nx, width, height
    else:
        fixed = int(x + 0.5)
        centre, per, size, lines = y - (fixed - x) * nx / ny, ny, height, width
    if not 0 <= fixed < lines:
        return 0
    far = reach / abs(per)
    first = max(int(math.ceil(centre - far)), 1)
    last = min(int(math.floor(centre + far)), size - 2)
    if first > last:
        return 0
    step_row, step_column = (0, 1) if across_x else (1, 0)
    row, column = (fixed, first) if across_x else (first, fixed)
    before = _across(image, row - step_row, column - step_column, nx, ny, signed)
    here = _across(image, row, column, nx, ny, signed)
    count, limit = 0, least * GAIN
    for k in range(first, last + 1):
        after = _across(image, row + step_row, column + step_column, nx, ny, signed)
        if here >= limit and here > before and here >= after:
            along = abs(image.dx[row, column] * ny - image.dy[row, column] * nx)
            open_here = not image.region.masked or image.region.seen[row, column]
            if open_here and along <= TURNED * here:
                peak = 0.5 * (before - after) / (before - here + (after - here))
                count = _insert(found, strength, count, (k + peak - centre) * per,
                                here / GAIN)
        before, here = here, after
        row += step_row
        column += step_column
    return count
