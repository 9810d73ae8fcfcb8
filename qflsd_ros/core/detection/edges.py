"""
Step 1a: gradients, Canny's edge map, and where between the pixels an edge lies.

Gradients are in grey levels: a step of h grey levels across an edge gives the magnitude h.
References: J. Canny, A computational approach to edge detection, PAMI 1986; F. Devernay, A
non-maxima suppression method for edge detection with sub-pixel accuracy, INRIA RR-2724, 1995.
"""
from __future__ import annotations

import math

import cv2
import numpy as np

from qflsd_ros.core.compilation import compiled, inlined

# Units of dx and dy for a step of one grey level: the largest, 2 GAIN 255, fits into 16 bits.
GAIN = 64
WEAK, STRONG, VISITED = 1, 2, 4     # edge pixels in the edge map; VISITED: part of a chain


@inlined
def _sobel_row(above: np.ndarray, here: np.ndarray, below: np.ndarray, dx: np.ndarray,
               dy: np.ndarray) -> None:
    """Write the Sobel gradients of one row, but for its first and last pixel."""
    scale, half = np.float32(GAIN / 4), np.float32(0.5)
    out_x, out_y = dx[1:-1], dy[1:-1]
    for i in range(len(out_x)):
        left = above[i] + here[i] + here[i] + below[i]
        right = above[i + 2] + here[i + 2] + here[i + 2] + below[i + 2]
        up = above[i] + above[i + 1] + above[i + 1] + above[i + 2]
        down = below[i] + below[i + 1] + below[i + 1] + below[i + 2]
        x, y = scale * (right - left), scale * (down - up)
        out_x[i] = np.int16(x + math.copysign(half, x))
        out_y[i] = np.int16(y + math.copysign(half, y))


@inlined
def _sobel_at_border(above: np.ndarray, here: np.ndarray, below: np.ndarray, dx: np.ndarray,
                     dy: np.ndarray) -> None:
    """Write the Sobel gradients of the first and last pixel of a row that continues linearly."""
    last = len(dx) - 1
    for at, inner, sign in ((0, 1, 1), (last, last - 1, -1)):
        rise = above[inner] - above[at] + 2 * (here[inner] - here[at]) + below[inner] - below[at]
        dx[at] = np.int16(round(sign * GAIN / 2 * rise))
        dy[at] = np.int16(round(GAIN * (below[at] - above[at])))


@compiled
def _sobel(blurred: np.ndarray, dx: np.ndarray, dy: np.ndarray) -> None:
    """Write the Sobel gradients of a (H, W) float32 image, continued linearly outside."""
    height, width = blurred.shape
    for row in range(height):
        above, below = blurred[max(row - 1, 0)], blurred[min(row + 1, height - 1)]
        _sobel_row(above, blurred[row], below, dx[row], dy[row])
        _sobel_at_border(above, blurred[row], below, dx[row], dy[row])


def gradients(gray: np.ndarray, blur_sigma: float, blurred: np.ndarray,
              dx: np.ndarray, dy: np.ndarray) -> None:
    """
    Write the Sobel gradients of a blurred (H, W) uint8 image to (H, W) int16 dx and dy.

    Beyond its border the image is continued as steep as it ends there.  Continued by its last
    pixel it would have half the gradient across the border, so that edges that run out of the
    image would seem to turn and follow it.
    """
    if blur_sigma > 0:
        side = 2 * max(1, math.ceil(1.6 * blur_sigma)) + 1
        kernel = cv2.getGaussianKernel(side, blur_sigma, cv2.CV_32F)
        cv2.sepFilter2D(gray, cv2.CV_32F, kernel, kernel, blurred, borderType=cv2.BORDER_REPLICATE)
    else:
        blurred[:] = gray
    _sobel(blurred, dx, dy)
    for outermost in (dy[0], dy[-1]):
        np.multiply(outermost, 2, outermost)


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


@inlined
def _thin(gx: np.ndarray, gy: np.ndarray, above: np.ndarray, here: np.ndarray, below: np.ndarray,
          low: np.float32, high: np.float32, edges: np.ndarray) -> np.int32:
    """Find the edge pixels of one row by its magnitudes and those beside it; return how many."""
    gx, gy, out = gx[1:-1], gy[1:-1], edges[1:-1]
    up, down = above[1:-1], below[1:-1]
    left, mid, right = here[:-2], here[1:-1], here[2:]
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
        found = _thin(dx[row], dy[row], magnitudes[(row - 1) % 3], magnitudes[row % 3],
                      magnitudes[(row + 1) % 3], weak, strong, edges[row])
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
    # Below 0, since a < b >= c.
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
