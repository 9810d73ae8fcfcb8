"""
Tell an arc from an accident.

A-contrario (Desolneux, Moisan and Morel 2000; LSD; EDLines): were it one, the gradient at each of
its edge points would lie within 11.25 degrees of its normal, on either side, by chance alone.
That chance is about 1/8 for random directions, and larger where there is texture all around, as
strong as the arc itself, whose contours the edge points follow.  Of n points k are aligned.  The
number of false alarms is the number of arcs looked at, times the probability of k or more of n.

Points count in full only where the gradient is strong: the weaker, the more it is noise.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import compiled

ALIGNED = math.cos(math.radians(11.25))
CHANCE, CHANCE_BUSY = 0.1, 0.5          # of alignment: at least, and more in busy surroundings
BUSY = 0.5                              # of an arc's contrast: what is strong in its surroundings
BESIDE = (-8.0, -4.0, 4.0, 8.0)         # px from the arc, where surroundings are looked at
EVERY = 6                               # edge points from one look to the next


@compiled
def support(fits: np.ndarray, arc: int, points: np.ndarray, first: int, last: int,
            clear: float) -> tuple[float, float, float, float]:
    """
    Compare the gradients at edge points ``first`` to ``last`` with the normal of a fit.

    ``points`` are as :func:`edges.locate` leaves them; a gradient of ``clear`` grey levels counts
    half.  Returns the weight of all points, that of the aligned ones, the sum of the steps across
    the arc in grey levels, and the number of points where P grows with the grey level less those
    where it falls.
    """
    ox, oy, a, b, c = fits[arc, 0], fits[arc, 1], fits[arc, 2], fits[arc, 3], fits[arc, 4]
    total, aligned, contrast, signs = 0.0, 0.0, 0.0, 0.0
    for i in range(first, last + 1):
        gx, gy = float(points[2, i]), float(points[3, i])
        across = gx * (2 * a * (points[0, i] - ox) + b) + gy * (2 * a * (points[1, i] - oy) + c)
        size = math.sqrt(gx * gx + gy * gy)
        weight = size / (size + clear)
        total += weight
        if abs(across) > ALIGNED * size:
            aligned += weight
        contrast += abs(across)
        signs += 1.0 if across > 0 else -1.0
    return total, aligned, contrast, signs


@compiled
def busyness(fits: np.ndarray, arc: int, points: np.ndarray, first: int, last: int,
             magnitude: np.ndarray, strong: float) -> tuple[int, int]:
    """Return how many places beside an arc were looked at, and how many of them are strong."""
    height, width = magnitude.shape
    looks = found = 0
    for i in range(first, last + 1, EVERY):
        x, y = float(points[0, i]), float(points[1, i])
        nx = 2 * fits[arc, 2] * (x - fits[arc, 0]) + fits[arc, 3]
        ny = 2 * fits[arc, 2] * (y - fits[arc, 1]) + fits[arc, 4]
        for offset in BESIDE:
            column = min(max(int(x + offset * nx + 0.5), 0), width - 1)
            row = min(max(int(y + offset * ny + 0.5), 0), height - 1)
            looks += 1
            found += magnitude[row, column] > strong
    return looks, found


@compiled
def score(n: float, k: float, busy: float, candidates: int) -> float:
    """
    Return -log10 of the number of false alarms (NFA), 0 or above for an arc that is none.

    ``n`` and ``k`` are the weights of all and of the aligned points, ``busy`` the share of strong
    places in the surroundings; the binomial tail is taken by Hoeffding's bound.
    """
    share, chance = k / n, CHANCE + CHANCE_BUSY * busy
    surprise = 0.0
    if share > chance:
        surprise = share * math.log10(share / chance)
        if share < 1:
            surprise += (1 - share) * math.log10((1 - share) / (1 - chance))
    return n * surprise - math.log10(candidates)
