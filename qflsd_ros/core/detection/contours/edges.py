"""
Step 1b: Canny's edge map, and where between the pixels an edge lies.

References: J. Canny, A computational approach to edge detection, PAMI 1986; F. Devernay, A
non-maxima suppression method for edge detection with sub-pixel accuracy, INRIA RR-2724, 1995.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.contours.gradients import GAIN

WEAK, STRONG, VISITED = 1, 2, 4     # edge pixels in the edge map; VISITED: part of a chain


@inlined
def _magnitude(gx: int, gy: int) -> np.float32:
    """Return the gradient's magnitude in grey levels."""
    x, y = np.float32(gx), np.float32(gy)
    return np.float32(1 / GAIN) * np.float32(math.sqrt(x * x + y * y))


@inlined
def _magnitudes(gx: np.ndarray, gy: np.ndarray, magnitude: np.ndarray) -> None:
    """Write the gradient's magnitude in one row."""
    for i in range(len(magnitude)):
        magnitude[i] = _magnitude(gx[i], gy[i])


class Rows(NamedTuple):
    """The gradient's magnitudes in a row of the image and in those beside it, (W,) float32."""

    above: np.ndarray
    here: np.ndarray
    below: np.ndarray


@inlined
def _thin(gx: np.ndarray, gy: np.ndarray, rows: Rows, low: np.float32, high: np.float32,
          edges: np.ndarray) -> np.int32:
    """Find the edge pixels of the row ``rows.here``; return their number."""
    gx, gy, out = gx[1:-1], gy[1:-1], edges[1:-1]
    up, down = rows.above[1:-1], rows.below[1:-1]
    left, mid, right = rows.here[:-2], rows.here[1:-1], rows.here[2:]
    found = np.int32(0)
    for i in range(len(out)):
        m, um, dm, ll, rr = mid[i], up[i], down[i], left[i], right[i]
        across_x = abs(np.float32(gx[i])) >= abs(np.float32(gy[i]))
        before = ll if across_x else um
        after = rr if across_x else dm
        edge = (m > before) & (m >= after) & (m >= low)
        strong = edge & (m >= high)
        out[i] = np.uint8(edge) * np.uint8(WEAK) + np.uint8(strong) * np.uint8(STRONG - WEAK)
        found += np.int32(edge)
    return found


@compiled
def find(dx: np.ndarray, dy: np.ndarray, low: float, high: float, magnitudes: np.ndarray,
         edges: np.ndarray) -> int:
    """
    Find the pixels at which the magnitude is largest across the edge (Canny).

    Each is compared with its two neighbours along x or y, whichever is closer to the gradient, so
    that an edge in any direction is one pixel wide.  The loops have no branches, so that the
    compiler can do several pixels at once.

    Parameters
    ----------
    dx, dy
        (H, W) int16, as :func:`gradients` leaves them; H and W at least 3.
    low, high
        Magnitudes in grey levels from which on a pixel is weak or strong.
    magnitudes
        (3, W) float32, scratch.
    edges
        (H, W) uint8, takes WEAK or STRONG at edge pixels, 0 elsewhere and in the outermost rows
        and columns.

    Returns
    -------
    Number of edge pixels.

    """
    height, width = edges.shape
    weak, strong = np.float32(low), np.float32(high)
    edges[0], edges[height - 1], edges[:, 0], edges[:, width - 1] = 0, 0, 0, 0
    _magnitudes(dx[0], dy[0], magnitudes[0])
    _magnitudes(dx[1], dy[1], magnitudes[1])
    count = 0
    for row in range(1, height - 1):
        _magnitudes(dx[row + 1], dy[row + 1], magnitudes[(row + 1) % 3])
        rows = Rows(magnitudes[(row - 1) % 3], magnitudes[row % 3], magnitudes[(row + 1) % 3])
        found = _thin(dx[row], dy[row], rows, weak, strong, edges[row])
        count += int(found)
    return count


@inlined
def offset_of(dx: np.ndarray, dy: np.ndarray, width: int,
              at: int) -> tuple[np.float32, np.float32]:
    """
    Return where an edge lies, relative to the centre of its edge pixel, x and y, px (Devernay).

    The parabola through the magnitudes at the pixel and at the two neighbours along x or y that it
    was compared with has its maximum there.  ``dx`` and ``dy`` are (H W,), ``at`` is y width + x.
    """
    gx, gy = np.float32(dx[at]), np.float32(dy[at])
    across_x = abs(gx) >= abs(gy)
    step = 1 if across_x else width
    a, b, c = (_magnitude(dx[at - step], dy[at - step]), _magnitude(dx[at], dy[at]),
               _magnitude(dx[at + step], dy[at + step]))
    # No division by 0, since a < b >= c.
    offset = np.float32(0.5) * (a - c) / (a - b + (c - b))
    zero = np.float32(0)
    return offset if across_x else zero, zero if across_x else offset


@compiled
def locate(dx: np.ndarray, dy: np.ndarray, width: int, pixels: np.ndarray, n: int,
           points: np.ndarray) -> None:
    """
    Find the subpixel positions of edge pixels, and the gradients there.

    Parameters
    ----------
    dx, dy
        (H W,) int16 gradients.
    width
        Pixels in a row.
    pixels, n
        (E,) int32, of which the first n are edge pixels: y width + x.
    points
        (4, E) float32, receives the positions x and y, px, and the gradients, grey levels.

    """
    scale, rows = np.float32(1 / GAIN), 1 / width
    for i in range(n):
        at = pixels[i]
        x, y = offset_of(dx, dy, width, at)
        row = int((at + 0.5) * rows)    # exact for any number of 32 bits, without a division
        points[0, i] = np.float32(at - row * width) + x
        points[1, i] = np.float32(row) + y
        points[2, i], points[3, i] = scale * np.float32(dx[at]), scale * np.float32(dy[at])
