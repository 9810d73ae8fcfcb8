"""Normals of many tracks with the edges on them, from which the motion field is estimated."""
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
# Least contrast of an edge on a normal: as a share of the track's contrast, and in standard
# deviations of the gradient noise; chosen, not tuned.
FAINTEST, ABOVE_NOISE = 0.25, 2.5
# Polarity of a track from which on only edges of the same polarity match it; chosen, not tuned.
ONE_SIDED = 0.6


@compiled
def weakest(rows: np.ndarray, i: int, noise: float) -> float:
    """Return the least contrast of an edge that matches track i, grey levels."""
    return max(FAINTEST * rows[i, CONTRAST], ABOVE_NOISE * noise)


@compiled
def look(image: Frame, before: np.ndarray, rows: np.ndarray, chosen: np.ndarray,
         each: int, shift: tuple[float, float], reach: float, looks: np.ndarray,
         found: np.ndarray, counts: np.ndarray) -> int:
    """
    Find the edges along normals of some tracks.

    Parameters
    ----------
    image
        The frame.
    before, rows
        (M, COLUMNS) float64, the tracks in the frame before, and at their predicted places.
    chosen
        (N,) int64, numbers of the tracks to use.
    each
        Number of normals of each track.
    shift
        Added to the predicted places, px.
    reach
        Length of a normal on either side of the track, px.
    looks, found, counts
        (N each, LOOK) float64, (N each + 1, EDGES) float64 and (N each,) int64: receive the
        normals in sight, the distances of the edges on each, px, and the number of these edges.
        The last row of ``found`` is scratch.

    Returns
    -------
    Number of normals in sight.

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
    """Return the distance of the edge nearest to an expected one, px; inf without edges."""
    best = np.inf
    for k in range(count):
        if abs(found[k] - expected) < abs(best - expected):
            best = found[k]
    return best
