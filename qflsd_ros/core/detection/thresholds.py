"""
Thresholds: how strong the edges of an image are, which is less in the dark and out of focus.

The contrasts in Parameters are meant for photographs of usual contrast.  They are multiplied by
the strength of the image, and stay above its noise, so that they need no tuning for another
exposure.  The strength is that of the steepest slopes along lines all over the image, since lines
cross edges.
"""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.region import Region, region

LINES = 12              # in each direction
PIECES = 16             # of a line
SMALLEST = PIECES + 2   # px, of a side: a piece has one pixel at least
STRONGEST = 0.03        # share of the pieces that cross a strong edge in most photographs
USUAL = 110.0           # grey levels between pixels two apart, in the weakest of these pieces
# Least and largest strength, as shares of that: weaker slopes are not edges, and thresholds follow
# the gain of a camera up to the largest (tuned on photographs under changes of light).
WEAKEST, LARGEST = 0.35, 2.5
ABOVE_NOISE = 3.5       # contrast_high in standard deviations of the gradient noise, at least


@inlined
def _steepest(lines: np.ndarray, seen: np.ndarray, masked: bool, top: int, bottom: int, left: int,
              right: int, slopes: np.ndarray, count: int) -> int:
    """
    Append the largest difference of pixels two apart in each piece of lines all over a region.

    ``lines`` and ``seen`` are (H, W) uint8 and bool, ``slopes`` (2 LINES PIECES,) float64, of
    which ``count`` are filled; returns the new count.  Pieces masked everywhere have none.
    """
    width = right - left - 2
    for i in range(LINES):
        y = top + (2 * i + 1) * (bottom - top) // (2 * LINES)
        for j in range(PIECES):
            steepest = np.int32(-1)
            for x in range(left + 1 + j * width // PIECES, left + 1 + (j + 1) * width // PIECES):
                if masked and not seen[y, x]:
                    continue
                slope = abs(np.int32(lines[y, x + 1]) - np.int32(lines[y, x - 1]))
                steepest = max(steepest, slope)
            slopes[count] = steepest
            count += int(steepest >= 0)
    return count


@compiled
def _slopes(gray: np.ndarray, where: Region, slopes: np.ndarray) -> int:
    """Write the steepest slopes along rows, and along columns; return how many there are."""
    top, bottom, left, right = where.top, where.bottom, where.left, where.right
    count = _steepest(gray, where.seen, where.masked, top, bottom, left, right, slopes, 0)
    return _steepest(gray.T, where.seen.T, where.masked, left, right, top, bottom, slopes, count)


def estimate(gray: np.ndarray, where: Region | None = None) -> float:
    """
    Return the strength of the edges of an image, as a share of the usual: WEAKEST to LARGEST.

    ``gray`` is a (H, W) uint8 array, looked at in a region of it (None: all over); one too small
    to tell is taken for usual.
    """
    where = region(gray.shape, None) if where is None else where
    if min(where.bottom - where.top, where.right - where.left) < SMALLEST:
        return 1.0
    slopes = np.empty(2 * LINES * PIECES)
    count = _slopes(gray, where, slopes)
    if count == 0:
        return 1.0
    place = int((1 - STRONGEST) * count)
    slopes[:count].partition(place)
    return min(max(float(slopes[place]) / USUAL, WEAKEST), LARGEST)


def scale(strength: float, noise: float, high: float) -> float:
    """
    Return by how much to multiply the contrasts that edges must have.

    Parameters
    ----------
    strength
        Of the edges of the image, as a share of the usual.
    noise
        Standard deviation of its gradient's noise, grey levels.
    high
        Contrast that a clear edge of an image of usual strength has, grey levels.

    """
    return max(strength, ABOVE_NOISE * noise / high)
