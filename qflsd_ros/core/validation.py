"""
Is an arc more than an accident?

A-contrario (Desolneux, Moisan and Morel 2000; LSD; EDLines): were the gradients' directions random,
each would lie within 11.25 degrees of the arc's normal, on either side, with probability 1/8.  Of n
edge points k do.  The number of false alarms is the number of arcs that one could have asked for,
times the probability of k or more of n.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import compiled

ALIGNED = math.cos(math.radians(11.25))
CHANCE = 0.125          # of a random direction to be aligned


@compiled
def support(fits: np.ndarray, arc: int, points: np.ndarray, first: int,
            last: int) -> tuple[int, float, float]:
    """
    Compare the gradients at edge points ``first`` to ``last`` with the normal of a fit.

    ``points`` are as :func:`edges.locate` leaves them.  Returns the number of aligned ones, the sum
    of the steps across the arc in grey levels, and the number of points where P grows with the
    grey level less those where it falls.
    """
    ox, oy, a, b, c = fits[arc, 0], fits[arc, 1], fits[arc, 2], fits[arc, 3], fits[arc, 4]
    aligned, contrast, signs = 0, 0.0, 0.0
    for i in range(first, last + 1):
        gx, gy = float(points[2, i]), float(points[3, i])
        across = gx * (2 * a * (points[0, i] - ox) + b) + gy * (2 * a * (points[1, i] - oy) + c)
        if across * across > ALIGNED ** 2 * (gx * gx + gy * gy):
            aligned += 1
        contrast += abs(across)
        signs += 1.0 if across > 0 else -1.0
    return aligned, contrast, signs


@compiled
def score(n: float, k: float, pixels: int) -> float:
    """
    Return -log10 of the number of false alarms (NFA), 0 or above for an arc that is none.

    Two ends in any pixels make ``pixels`` ^ 2 arcs that one could have asked for; the binomial
    tail is taken by Hoeffding's bound.
    """
    share = k / n
    surprise = 0.0
    if share > CHANCE:
        surprise = share * math.log10(share / CHANCE)
        if share < 1:
            surprise += (1 - share) * math.log10((1 - share) / (1 - CHANCE))
    return n * surprise - 2 * math.log10(pixels)
