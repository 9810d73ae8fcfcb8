"""
Thresholds: the contrasts that edges must have, adapted to the contrast and noise of an image.

The contrasts in Parameters are meant for photographs of usual contrast.  They are multiplied by
the strength of the image, which is low in the dark and out of focus, and stay above its noise, so
that another exposure needs no tuning.  The strength is measured by the steepest slopes along rows
and columns all over the image, since these cross its edges.
"""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.region import Region, region, transposed

# All of these are chosen, not tuned, unless stated otherwise.
LINES = 12              # rows, and columns, that are sampled
PIECES = 16             # of a line, each with one steepest slope
SMALLEST = PIECES + 2   # px, of a side: a piece has one pixel at least
STRONGEST = 0.03        # share of the pieces that cross a strong edge in most photographs
USUAL = 110.0           # grey levels over 2 px, slope of the weakest of these
# Least and largest strength, as shares of USUAL: weaker slopes are not edges, and thresholds
# follow the gain of a camera up to the largest (tuned on photographs under changes of light).
WEAKEST, LARGEST = 0.35, 2.5
ABOVE_NOISE = 3.5       # contrast_high in standard deviations of the gradient noise, at least


@inlined
def _steepest(gray: np.ndarray, where: Region, slopes: np.ndarray, count: int) -> int:
    """
    Append the steepest slope of each piece of the sampled rows of a region.

    A slope is the difference of two pixels at a distance of 2 px.  ``gray`` is (H, W) uint8,
    ``slopes`` (2 LINES PIECES,) float64, of which ``count`` are filled; returns the new count.
    Pieces that are masked everywhere are skipped.
    """
    first, width = where.left + 1, where.right - where.left - 2
    for i in range(LINES):
        y = where.top + (2 * i + 1) * (where.bottom - where.top) // (2 * LINES)
        for j in range(PIECES):
            steepest = np.int32(-1)
            for x in range(first + j * width // PIECES, first + (j + 1) * width // PIECES):
                if where.masked and not where.seen[y, x]:
                    continue
                slope = abs(np.int32(gray[y, x + 1]) - np.int32(gray[y, x - 1]))
                steepest = max(steepest, slope)
            slopes[count] = steepest
            count += int(steepest >= 0)
    return count


@compiled
def _slopes(gray: np.ndarray, where: Region, slopes: np.ndarray) -> int:
    """Write the steepest slopes along rows, then along columns; return their number."""
    count = _steepest(gray, where, slopes, 0)
    return _steepest(gray.T, transposed(where), slopes, count)


def estimate(gray: np.ndarray, where: Region | None = None) -> float:
    """
    Return the strength of the edges of an image, as a share of the usual: WEAKEST to LARGEST.

    ``gray`` is (H, W) uint8; only ``where``, a region of it, is used (None: all of it).  A region
    below SMALLEST px, or masked everywhere, has the strength 1.
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
    Return the factor of ``contrast_low`` and ``contrast_high`` for one image.

    Parameters
    ----------
    strength
        Of the edges of the image, as :func:`estimate` returns it.
    noise
        Standard deviation of the noise of its gradients, grey levels.
    high
        ``contrast_high`` of the parameters, grey levels.

    """
    return max(strength, ABOVE_NOISE * noise / high)
