"""
The common translation of tracks, by a Hough transform.

An edge at the distance d along the normal n of a track is consistent with all translations u with
n.u = d: a line in the plane of translations.  It votes for each cell of that line (Hough, 1962).
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import compiled
from qflsd_ros.core.tracking.motion.looks import Looks, NX, NY


@compiled
def _enter(votes: np.ndarray, nx: float, ny: float, d: float) -> None:
    """Add the votes of an edge along its line."""
    reach = len(votes) // 2
    if abs(nx) >= abs(ny):
        slope, middle = ny / nx, d / nx + 0.5
        for j in range(-reach, reach + 1):
            i = int(math.floor(middle - j * slope))
            if -reach <= i <= reach:
                votes[j + reach, i + reach] += 1
    else:
        slope, middle = nx / ny, d / ny + 0.5
        for i in range(-reach, reach + 1):
            j = int(math.floor(middle - i * slope))
            if -reach <= j <= reach:
                votes[j + reach, i + reach] += 1


@compiled
def translation(looks: Looks, n: int, votes: np.ndarray) -> tuple[float, float]:
    """
    Return the translation x, y with the most votes, px.

    Parameters
    ----------
    looks, n
        Normals and their number, of :func:`looks.look`.
    votes
        (2 R + 1, 2 R + 1) int32, scratch: translations up to R px either way.

    """
    votes[:] = 0
    for k in range(n):
        for e in range(looks.counts[k]):
            _enter(votes, looks.places[k, NX], looks.places[k, NY], looks.found[k, e])
    best, best_i, best_j = -1.0, 0, 0
    reach = len(votes) // 2
    for j in range(1, len(votes) - 1):
        for i in range(1, len(votes) - 1):
            here = 0
            for r in range(-1, 2):
                here += votes[j + r, i - 1] + votes[j + r, i] + votes[j + r, i + 1]
            if here > best:
                # Of equals the smallest motion.
                value = here - 0.01 * math.hypot(i - reach, j - reach)
                if value > best:
                    best, best_i, best_j = value, i, j
    return float(best_i - reach), float(best_j - reach)
