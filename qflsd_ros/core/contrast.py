"""
How strong the edges of an image are: less in the dark, in fog and out of focus.

What is an edge is said for photographs of usual contrast.  In a weaker image an edge is weaker in
proportion, as long as it stands out from the noise: so it is that nobody needs to tune thresholds
for another exposure.  The strength of an image is that of its strongest slopes, along lines all
over it, since those cross edges.
"""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined

LINES = 12              # looked at in each direction
PIECES = 16             # of a line
SMALLEST = PIECES + 2   # px, of a side; less shows no pieces
STRONGEST = 0.03        # share of all pieces that are believed to cross an edge
USUAL = 110.0           # grey levels from pixel to next but one, that these have at least
WEAKEST = 0.35          # share of that, below which slopes are no edges
ABOVE_NOISE = 3.5       # standard deviations of noise that an edge stands out


@inlined
def _steepest(lines: np.ndarray, slopes: np.ndarray) -> None:
    """
    Write the largest difference of pixels two apart in each piece of lines all over an image.

    ``lines`` is (H, W) uint8 with sides of at least SMALLEST, ``slopes`` (LINES PIECES,).
    """
    height, width = lines.shape
    for i in range(LINES):
        y = (2 * i + 1) * height // (2 * LINES)
        for j in range(PIECES):
            steepest = 0
            for x in range(1 + j * (width - 2) // PIECES, 1 + (j + 1) * (width - 2) // PIECES):
                slope = abs(np.int32(lines[y, x + 1]) - np.int32(lines[y, x - 1]))
                steepest = max(steepest, slope)
            slopes[i * PIECES + j] = steepest


@compiled
def _slopes(gray: np.ndarray, slopes: np.ndarray) -> None:
    """Write the steepest slopes along rows, and along columns: (2 LINES PIECES,)."""
    _steepest(gray, slopes[:LINES * PIECES])
    _steepest(gray.T, slopes[LINES * PIECES:])


def estimate(gray: np.ndarray) -> float:
    """
    Return the strength of the edges of an image, as a share of the usual: WEAKEST to 1.

    ``gray`` is a (H, W) uint8 array; one too small to tell is taken for usual.
    """
    if min(gray.shape) < SMALLEST:
        return 1.0
    slopes = np.empty(2 * LINES * PIECES)
    _slopes(gray, slopes)
    place = int((1 - STRONGEST) * len(slopes))
    slopes.partition(place)
    return min(max(float(slopes[place]) / USUAL, WEAKEST), 1.0)


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
