"""
Step 1a: the gradients of a smoothed image.

Gradients are in grey levels: a step of h grey levels across an edge gives the magnitude h.
One pass goes down the image row by row: rows of the image are smoothed into a ring of three rows,
and the Sobel gradients of the middle one follow at once, so that these rows stay in the
first cache of the processor.  Gradients are rounded to 1/64 grey level, so that edges of low
contrast are located as exactly as others.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np

from qflsd_ros.core.compilation import compiled, inlined

# Units of dx and dy for a step of one grey level: the largest, 2 GAIN 255, fits into 16 bits.
GAIN = 64
# Standard deviations of a Gaussian within its kernel, at each side, at least; chosen, not tuned.
REACH = 1.6


Pair = tuple[np.ndarray, np.ndarray]    # two rows at the same distance, at both sides


class Rows(NamedTuple):
    """Rows of an image of width W that :func:`_compute` works on: float32."""

    ring: np.ndarray        # (3, W): the smoothed rows above, at and below the current row
    column: np.ndarray      # (W + 2 reach,): a row smoothed along y alone, continued at its ends
    sums: np.ndarray        # (W,): sums along y with the weights 1, 2, 1
    rises: np.ndarray       # (W,): differences along y


def _half_kernel(sigma: float) -> np.ndarray:
    """Return a Gaussian kernel from its middle on, 0 beyond its reach: (K,) float32, K >= 3."""
    kernel = np.array([1, 0, 0], np.float32)
    if sigma > 0:
        reach = max(1, math.ceil(REACH * sigma))
        half = cv2.getGaussianKernel(2 * reach + 1, sigma, cv2.CV_32F)[reach:, 0]
        kernel = np.zeros(max(len(half), len(kernel)), np.float32)
        kernel[:len(half)] = half
    return kernel


@inlined
def _smooth(kernel: np.ndarray, here: np.ndarray, near: Pair, far: Pair, out: np.ndarray) -> None:
    """Write a row weighted with those at a distance of 1 and 2, by the first three weights."""
    for i in range(len(out)):
        out[i] = (kernel[0] * np.float32(here[i])
                  + kernel[1] * (np.float32(near[0][i]) + np.float32(near[1][i]))
                  + kernel[2] * (np.float32(far[0][i]) + np.float32(far[1][i])))


@inlined
def _add_pair(weight: np.float32, pair: Pair, out: np.ndarray) -> None:
    """Add the weighted sums of two rows to a row."""
    for i in range(len(out)):
        out[i] += weight * (np.float32(pair[0][i]) + np.float32(pair[1][i]))


@inlined
def _above_and_below(gray: np.ndarray, row: int, k: int) -> Pair:
    """Return the rows at a distance of k; beyond the border, those at the border."""
    return gray[max(row - k, 0)], gray[min(row + k, len(gray) - 1)]


@inlined
def _shifted(row: np.ndarray, reach: int, k: int) -> Pair:
    """Return a row that is ``reach`` px longer at both sides, shifted by k px both ways."""
    width = len(row) - 2 * reach
    return row[reach - k:reach - k + width], row[reach + k:reach + k + width]


@inlined
def _smooth_row(gray: np.ndarray, row: int, kernel: np.ndarray, column: np.ndarray,
                out: np.ndarray) -> None:
    """Write a smoothed row; ``column``, scratch, has room for the kernel's reach at both sides."""
    reach, width = len(kernel) - 1, gray.shape[1]
    inner = column[reach:reach + width]
    _smooth(kernel, gray[row], _above_and_below(gray, row, 1), _above_and_below(gray, row, 2),
            inner)
    for k in range(3, len(kernel)):
        _add_pair(kernel[k], _above_and_below(gray, row, k), inner)
    column[:reach], column[reach + width:] = inner[0], inner[width - 1]
    _smooth(kernel, inner, _shifted(column, reach, 1), _shifted(column, reach, 2), out)
    for k in range(3, len(kernel)):
        _add_pair(kernel[k], _shifted(column, reach, k), out)


@inlined
def _sobel_row(above: np.ndarray, here: np.ndarray, below: np.ndarray, rows: Rows,
               dx: np.ndarray, dy: np.ndarray) -> None:
    """Write the Sobel gradients of one row, but for its first and last pixel."""
    sums, rises = rows.sums, rows.rises
    scale, half = np.float32(GAIN / 4), np.float32(0.5)
    for i in range(len(here)):
        sums[i] = scale * (above[i] + below[i] + (here[i] + here[i]))
        rises[i] = scale * (below[i] - above[i])
    out_x, out_y = dx[1:-1], dy[1:-1]
    for i in range(len(out_x)):
        x = sums[i + 2] - sums[i]
        y = rises[i] + rises[i + 2] + (rises[i + 1] + rises[i + 1])
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
def _compute(gray: np.ndarray, kernel: np.ndarray, rows: Rows, dx: np.ndarray,
             dy: np.ndarray) -> None:
    """Compute the gradients of a smoothed image; ``kernel`` is the half of a symmetric kernel."""
    height = len(gray)
    ring, last = rows.ring, height - 1
    _smooth_row(gray, 0, kernel, rows.column, ring[0])
    for row in range(height):
        if row < last:
            _smooth_row(gray, row + 1, kernel, rows.column, ring[(row + 1) % 3])
        above, below = ring[max(row - 1, 0) % 3], ring[min(row + 1, last) % 3]
        _sobel_row(above, ring[row % 3], below, rows, dx[row], dy[row])
        _sobel_at_border(above, ring[row % 3], below, dx[row], dy[row])
    for i in range(len(dy[0])):
        dy[0, i] *= 2
        dy[last, i] *= 2


def compute(gray: np.ndarray, blur_sigma: float, dx: np.ndarray, dy: np.ndarray) -> None:
    """
    Compute the Sobel gradients of an image smoothed by a Gaussian.

    Beyond its border the image is continued as steep as it ends there.  Continued by its last
    pixel it would have half the gradient across the border, so that edges that run out of the
    image would seem to turn and follow it.

    Parameters
    ----------
    gray
        (H, W) uint8, C order; H and W at least 3.
    blur_sigma
        Standard deviation of the Gaussian, px; 0 for no smoothing.
    dx, dy
        (H, W) int16, receive the gradients in 1/GAIN grey level.

    """
    kernel, width = _half_kernel(blur_sigma), gray.shape[1]
    rows = Rows(np.empty((3, width), np.float32),
                np.empty(width + 2 * (len(kernel) - 1), np.float32),
                np.empty(width, np.float32), np.empty(width, np.float32))
    _compute(gray, kernel, rows, dx, dy)
