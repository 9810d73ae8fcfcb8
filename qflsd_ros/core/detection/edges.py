"""
Step 1a: gradients, Canny's edge map, and where between the pixels an edge lies.

Gradients are in grey levels: a step of h grey levels across an edge gives the magnitude h.
References: J. Canny, A computational approach to edge detection, PAMI 1986; F. Devernay, A
non-maxima suppression method for edge detection with sub-pixel accuracy, INRIA RR-2724, 1995.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.region import Region

SOBEL_GAIN = 4.0                # Sobel's response to a step of one grey level
WEAK, STRONG = 1, 2             # what an edge pixel is in the edge map
MORE = STRONG - WEAK


class Gradients(NamedTuple):
    """The gradients of a frame."""

    dx: np.ndarray          # (H, W) int16, of which ``gain`` is one grey level
    dy: np.ndarray
    gain: float
    noise: float            # standard deviation of dx and dy, grey levels
    region: Region          # where they count


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
        gray = cv2.GaussianBlur(gray, (side, side), blur_sigma, blurred,
                                borderType=cv2.BORDER_REPLICATE)
    cv2.spatialGradient(gray, dx, dy, ksize=3, borderType=cv2.BORDER_REPLICATE)
    for outermost in (dx[:, 0], dx[:, -1], dy[0], dy[-1]):
        np.multiply(outermost, 2, outermost)


@inlined
def _magnitude(gx: int, gy: int) -> np.float32:
    """Return the gradient's magnitude in grey levels."""
    x, y = np.float32(gx), np.float32(gy)
    return np.float32(1 / SOBEL_GAIN) * np.float32(math.sqrt(x * x + y * y))


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
        out[i] = np.uint8(edge) * np.uint8(WEAK) + np.uint8(edge & (m >= high)) * np.uint8(MORE)
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


@compiled
def locate(dx: np.ndarray, dy: np.ndarray, width: int, pixels: np.ndarray, n: int,
           points: np.ndarray) -> None:
    """
    Find the subpixel positions of edge pixels, after Devernay, and the gradients there.

    The gradient's magnitude at the pixel and at the two neighbours along x or y that it was
    compared with is taken for a parabola; its maximum lies on the edge.

    Parameters
    ----------
    dx, dy
        (H W,) int16 gradients.
    width
        Pixels in a row.
    pixels, n
        (E,) int32, of which the first n are edge pixels: y width + x.
    points
        (4, E) float32, takes the positions x and y, px, and the gradient in grey levels.

    """
    half, zero, scale = np.float32(0.5), np.float32(0), np.float32(1 / SOBEL_GAIN)
    rows = 1 / width
    for i in range(n):
        at = pixels[i]
        gx, gy = np.float32(dx[at]), np.float32(dy[at])
        across_x = abs(gx) >= abs(gy)
        step = 1 if across_x else width
        a, b, c = (_magnitude(dx[at - step], dy[at - step]), _magnitude(dx[at], dy[at]),
                   _magnitude(dx[at + step], dy[at + step]))
        # Below 0, since a < b >= c.
        offset = half * (a - c) / (a - b + (c - b))
        y = int((at + 0.5) * rows)      # exact for any number of 32 bits, and no division
        points[0, i] = np.float32(at - y * width) + (offset if across_x else zero)
        points[1, i] = np.float32(y) + (zero if across_x else offset)
        points[2, i], points[3, i] = scale * gx, scale * gy
