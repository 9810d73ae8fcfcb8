"""
Edges along the normals of an arc (moving edges).

P. Bouthemy, A maximum likelihood framework for determining moving edges, PAMI 1989.

A normal is sampled along x or y, whichever is closer to it, at the centres of pixels, so that
gradients need no interpolation.  The maximum is interpolated by the parabola of
:func:`detection.contours.edges.locate`.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import inlined
from qflsd_ros.core.detection.contours.gradients import GAIN
from qflsd_ros.core.detection.frame import Frame

# Largest tangent of the angle between the gradient at an edge and the normal; chosen, not tuned.
TURNED = math.tan(math.radians(30.0))
EDGES = 4               # edges kept on a normal, the closest to the arc; chosen, not tuned

# Least gradient of an edge, grey levels, and whether its sign counts.
Wanted = tuple[float, bool]


class Sight(NamedTuple):
    """An image of (H, W) pixels in which normals are searched, its rows one behind the other."""

    dx: np.ndarray          # (H W,) int16, as of a Frame
    dy: np.ndarray
    seen: np.ndarray        # (H W,) bool: where no masked pixel is near
    masked: bool            # whether any pixel is masked
    height: int
    width: int
    noise: float            # standard deviation of the gradients, grey levels


def sight(frame: Frame) -> Sight:
    """Return a frame as the searches along normals use it; its arrays are views."""
    height, width = frame.dx.shape
    return Sight(frame.dx.ravel(), frame.dy.ravel(), frame.region.seen.ravel(),
                 frame.region.masked, height, width, frame.noise)


@inlined
def in_sight(image: Sight, x: float, y: float) -> bool:
    """Return whether a point lies in the image, 1 px from its border, and near no masked pixel."""
    if not (1 <= x <= image.width - 2 and 1 <= y <= image.height - 2):
        return False
    return not image.masked or image.seen[int(y + 0.5) * image.width + int(x + 0.5)]


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
def _along(image: Sight, at: int, nx: float, ny: float, signed: bool) -> float:
    """Return the gradient along a normal at a pixel, in the units of the image."""
    # An unsigned index need not be tested for being negative.
    g = image.dx[np.uintp(at)] * nx + image.dy[np.uintp(at)] * ny
    return g if signed else abs(g)


@inlined
def _is_edge(image: Sight, at: int, nx: float, ny: float, g: float) -> bool:
    """Return whether a maximum g of the gradient is no masked pixel, and across the normal."""
    across = abs(image.dx[at] * ny - image.dy[at] * nx)
    return across <= TURNED * g and (not image.masked or image.seen[at])


@inlined
def edges_along(image: Sight, ray: tuple[float, float, float, float], reach: float,
                wanted: Wanted, found: np.ndarray, strength: np.ndarray) -> int:
    """
    Find the edges along a normal.

    Parameters
    ----------
    image
        The frame.
    ray
        A point in the image, px, and the unit normal there.
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
    if abs(nx) >= abs(ny):
        fixed, per, size, step = int(y + 0.5), nx, image.width, 1
        centre, origin = x - (fixed - y) * ny / nx, fixed * image.width
    else:
        fixed, per, size, step = int(x + 0.5), ny, image.height, image.width
        centre, origin = y - (fixed - x) * nx / ny, fixed
    far = reach / abs(per)
    first = max(int(math.ceil(centre - far)), 1)
    last = min(int(math.floor(centre + far)), size - 2)
    if first > last:
        return 0
    at = origin + first * step
    before = _along(image, at - step, nx, ny, signed)
    here = _along(image, at, nx, ny, signed)
    count, limit = 0, least * GAIN
    for k in range(first, last + 1):
        after = _along(image, at + step, nx, ny, signed)
        if here >= limit and here > before and here >= after and _is_edge(image, at, nx, ny, here):
            peak = 0.5 * (before - after) / (before - here + (after - here))
            count = _insert(found, strength, count, (k + peak - centre) * per, here / GAIN)
        before, here = here, after
        at += step
    return count
