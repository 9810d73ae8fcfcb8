"""Normals of many tracks with the edges on them, from which the motion field is estimated."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled
from qflsd_ros.core.tracking import curve
from qflsd_ros.core.tracking.normals import EDGES, edges_along, in_sight, Sight
from qflsd_ros.core.tracking.state import CONTRAST, POLARITY

# Columns of a place: a point of a track and the normal there; the same point in the frame before.
X, Y, NX, NY, WAS_X, WAS_Y, COLUMNS = range(7)
# Least contrast of an edge on a normal: as a share of the track's contrast, and in standard
# deviations of the gradient noise; chosen, not tuned.
FAINTEST, ABOVE_NOISE = 0.25, 2.5
# Polarity of a track from which on only edges of the same polarity match it; chosen, not tuned.
ONE_SIDED = 0.6


class Looks(NamedTuple):
    """Memory for N normals and the edges on each."""

    places: np.ndarray      # (N, COLUMNS) float64
    found: np.ndarray       # (N, EDGES) float64, distances of edges along the normal, px
    counts: np.ndarray      # (N,) int64, number of these edges
    strength: np.ndarray    # (EDGES,) float64, scratch


def memory(normals: int) -> Looks:
    """Return memory for a number of normals."""
    return Looks(np.empty((normals, COLUMNS)), np.empty((normals, EDGES)),
                 np.empty(normals, np.int64), np.empty(EDGES))


@compiled
def weakest(rows: np.ndarray, i: int, noise: float) -> float:
    """Return the least contrast of an edge that matches track i, grey levels."""
    return max(FAINTEST * rows[i, CONTRAST], ABOVE_NOISE * noise)


@compiled
def look(image: Sight, before: np.ndarray, rows: np.ndarray, chosen: np.ndarray,
         rays: tuple[int, float], looks: Looks) -> int:
    """
    Find the edges along normals of some tracks.

    Parameters
    ----------
    image
        The frame.
    before, rows
        (M, state.COLUMNS) float64, the tracks in the frame before, and at their predicted places.
    chosen
        (N,) int64, numbers of the tracks to use.
    rays
        Number of normals of each track, and their length on either side of it, px.
    looks
        Memory for all normals of these tracks; receives those in sight.

    Returns
    -------
    Number of normals in sight.

    """
    n = 0
    each, reach = rays
    for i in chosen:
        then, now = curve.curve(before, i), curve.curve(rows, i)
        wanted = weakest(rows, i, image.noise), rows[i, POLARITY] > ONE_SIDED
        for j in range(each):
            share = (2 * j + 1) / each - 1
            x, y, nx, ny = curve.at(now, share)
            if not in_sight(image, x, y):
                continue
            looks.counts[n] = edges_along(image, (x, y, nx, ny), reach, wanted, looks.found[n],
                                          looks.strength)
            was_x, was_y, _, _ = curve.at(then, share)
            looks.places[n] = x, y, nx, ny, was_x, was_y
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
