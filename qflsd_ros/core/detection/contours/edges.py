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
from qflsd_ros.core.detection.contours.sectors import ALONG_X, write_sectors
from qflsd_ros.core.detection.frame import Frame

# Bits of a pixel of the edge map, which is 0 off the edges: EDGE; STRONG, a strong pixel that no
# chain has reached yet; VISITED, a pixel of a chain; and the sector of the gradient.
EDGE, STRONG, VISITED, SECTOR = 128, 64, 32, 15

# From a pixel to its neighbours, x and y, in order from the x axis to the y axis and on.
STEPS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)], np.int64)
# Grey levels: a smaller curvature of the parabola through three magnitudes is rounding.
FLATTEST = np.float32(1e-6)


@inlined
def _magnitude(gx: int, gy: int) -> np.float32:
    """Return the gradient's magnitude in grey levels."""
    x, y = np.float32(gx), np.float32(gy)
    return np.float32(1 / GAIN) * np.float32(math.sqrt(x * x + y * y))


class Rows(NamedTuple):
    """Rows of an image of width W that :func:`find` works on."""

    squares: np.ndarray     # (3, W) int32: squared gradients above, at and below the current row
    sectors: np.ndarray     # (W,) uint8: of the gradients in the current row


@inlined
def _square(gx: np.ndarray, gy: np.ndarray, squares: np.ndarray) -> None:
    """Write the squared length of each gradient in a row."""
    for i in range(len(squares)):
        x, y = np.int32(gx[i]), np.int32(gy[i])
        squares[i] = x * x + y * y


@inlined
def _thin(rows: Rows, row: int, low: np.int32, high: np.int32, edges: np.ndarray) -> np.int32:
    """Find the edge pixels of a row; return their number."""
    out, sector, here = edges[1:-1], rows.sectors[1:-1], rows.squares[row % 3]
    up, down = rows.squares[(row - 1) % 3, 1:-1], rows.squares[(row + 1) % 3, 1:-1]
    left, mid, right = here[:-2], here[1:-1], here[2:]
    found = np.int32(0)
    for i in range(len(out)):
        m, um, dm, ll, rr = mid[i], up[i], down[i], left[i], right[i]
        along_x = (sector[i] & np.uint8(ALONG_X)) != 0
        before = ll if along_x else um
        after = rr if along_x else dm
        edge = (m > before) & (m >= after) & (m >= low)
        strong = edge & (m >= high)
        out[i] = (np.uint8(edge) * (sector[i] | np.uint8(EDGE))
                  | np.uint8(strong) * np.uint8(STRONG))
        found += np.int32(edge)
    return found


@inlined
def _hide(seen: np.ndarray, edges: np.ndarray) -> None:
    """Remove the edge pixels of a row that are not ``seen``."""
    for i in range(len(edges)):
        edges[i] *= np.uint8(seen[i])


@inlined
def _surround(up: np.ndarray, here: np.ndarray, down: np.ndarray, around: np.ndarray) -> None:
    """Write which of the 8 neighbours of each pixel in a row are edge pixels: a bit for each."""
    out = around[1:-1]
    e, w, n, s = here[2:], here[:-2], up[1:-1], down[1:-1]
    ne, nw, se, sw = up[2:], up[:-2], down[2:], down[:-2]
    for i in range(len(out)):
        out[i] = ((e[i] & EDGE) >> 7 | (se[i] & EDGE) >> 6 | (s[i] & EDGE) >> 5
                  | (sw[i] & EDGE) >> 4 | (w[i] & EDGE) >> 3 | (nw[i] & EDGE) >> 2
                  | (n[i] & EDGE) >> 1 | ne[i] & EDGE)


@compiled
def find(frame: Frame, rows: Rows, edges: np.ndarray, around: np.ndarray) -> int:
    """
    Find the pixels at which the magnitude is largest across the edge (Canny).

    Each is compared with its two neighbours along x or y, whichever is closer to the gradient, so
    that an edge in any direction is one pixel wide.  The loops have no branches, so that the
    compiler can do several pixels at once.

    Parameters
    ----------
    frame
        The gradients, and the thresholds of weak and strong pixels; H and W are at least 3.
    rows
        Scratch.
    edges
        (H, W) uint8, takes EDGE, the sector of the gradient (:mod:`sectors`) and, if it is strong,
        STRONG at edge pixels, and 0 elsewhere and in the outermost rows and columns.
    around
        (H, W) uint8, receives which neighbours are edge pixels: bit i for neighbour i of
        :data:`STEPS`.  The outermost rows and columns are left as they are.

    Returns
    -------
    Number of edge pixels, masked ones included.

    """
    dx, dy, (height, width) = frame.dx, frame.dy, edges.shape
    low, high = (np.int32(math.ceil((GAIN * frame.low) ** 2)),
                 np.int32(math.ceil((GAIN * frame.high) ** 2)))
    edges[0], edges[height - 1], edges[:, 0], edges[:, width - 1] = 0, 0, 0, 0
    _square(dx[0], dy[0], rows.squares[0])
    _square(dx[1], dy[1], rows.squares[1])
    count = 0
    for row in range(1, height - 1):
        _square(dx[row + 1], dy[row + 1], rows.squares[(row + 1) % 3])
        write_sectors(dx[row], dy[row], rows.sectors)
        count += int(_thin(rows, row, low, high, edges[row]))
        if frame.region.masked:
            _hide(frame.region.seen[row], edges[row])
        if row > 1:
            _surround(edges[row - 2], edges[row - 1], edges[row], around[row - 1])
    _surround(edges[height - 3], edges[height - 2], edges[height - 1], around[height - 2])
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
    # The square of b is above that of a and not below that of c; float32 may round all to one.
    offset = np.float32(0.5) * (c - a) / max(b - a + (b - c), FLATTEST)
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
