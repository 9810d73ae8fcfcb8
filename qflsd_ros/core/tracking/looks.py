"""Normals of many tracks, and the edges found on them: what motion and measurement start from."""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.compilation import compiled
from qflsd_ros.core.detection.frame import Frame
from qflsd_ros.core.tracking import curve
from qflsd_ros.core.tracking.normals import edges_along, in_sight
from qflsd_ros.core.tracking.state import CONTRAST, POLARITY

# Columns of a look: number of the track; share of the half chord; the point and the normal there;
# the same point in the frame before.
TRACK, SHARE, X, Y, NX, NY, WAS_X, WAS_Y, LOOK = range(9)
FAINTEST = 0.25     # of a track's contrast: an edge on a normal has at least
ABOVE_NOISE = 2.5   # standard deviations of the noise that it has at least
ONE_SIDED = 0.6     # polarity from which on only edges of the same sign are the track's own


@compiled
def weakest(rows: np.ndarray, i: int, noise: float) -> float:
    """Return the least contrast of an edge that may be one of a track, grey levels."""
    return max(FAINTEST * rows[i, CONTRAST], ABOVE_NOISE * noise)


@compiled
def look(image: Frame, before: np.ndarray, rows: np.ndarray, chosen: np.ndarray,
         each: int, shift: tuple[float, float], reach: float, looks: np.ndarray,
         found: np.ndarray, counts: np.ndarray) -> int:
    """
    Look along normals of some tracks.

    Parameters
    ----------
    image
        The frame.
    before, rows
        (M, COLUMNS) float64, the tracks in the frame before, and where they are expected.
    chosen
        (N,) int64, tracks to look at.
    each
        Normals of each.
    shift
        Added to where they are expected, px.
    reach
        How far to look on either side, px.
    looks, found, counts
        (N each, LOOK), (N each, EDGES) and (N each,), take the normals in sight, and the edges on
        them: their distances, px, and number.

    Returns
    -------
    How many normals are in sight.

    """
    n = 0
    strength = found[len(found) - 1]
    for i in chosen:
        then, now = curve.curve(before, i), curve.curve(rows, i)
        least = weakest(rows, i, image.noise)
        for j in range(each):
            share = (2 * j + 1) / each - 1
            x, y, nx, ny = curve.at(now, share)
            x, y = x + shift[0], y + shift[1]
            if not in_sight(image, x, y):
                continue
            was_x, was_y, _, _ = curve.at(then, share)
            counts[n] = edges_along(image, (x, y, nx, ny), reach, least,
                                    rows[i, POLARITY] > ONE_SIDED, found[n], strength)
            looks[n, TRACK], looks[n, SHARE], looks[n, X], looks[n, Y] = i, share, x, y
            looks[n, NX], looks[n, NY], looks[n, WAS_X], looks[n, WAS_Y] = nx, ny, was_x, was_y
            n += 1
    return n


@compiled
def nearest(found: np.ndarray, count: int, expected: float) -> float:
    """Return the edge of a normal that is nearest to an expected distance; inf without any."""
    best = np.inf
    for k in range(count):
        if abs(found[k] - expected) < abs(best - expected):
            best = found[k]
    return best
