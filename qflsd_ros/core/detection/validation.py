"""
Tell an arc from an accident.

A-contrario (Desolneux, Moisan and Morel 2000; LSD; EDLines): were it one, the gradient at each of
its edge points would lie within 11.25 degrees of its normal, on either side, by chance alone.
That chance is about 1/8 for random directions, and larger where there is texture all around, as
strong as the arc itself, whose contours the edge points follow.  Of n points k are aligned.  The
number of false alarms is the number of arcs looked at, times the probability of k or more of n.

Points count in full only where the gradient is strong: the weaker, the more it is noise.  What
noise turns it by is not held against it, and where that may be any angle it tells nothing.

Nor would the points of an accident lie as close to the arc: they would scatter over the width that
its tolerance leaves them.  The chance that so many distances are as small as they are is added.

Both chances are those of points that are independent of each other.  Neighbours share pixels and
blur, and arcs are looked for where points line up, so that the score orders arcs but promises
no rate: in images of noise alone the number of arcs falls by a factor of 1.5 to 6 for each
unit of the score, the less the coarser its grain is; see benchmark/false_alarms.py.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined, summed
from qflsd_ros.core.detection.edges import SOBEL_GAIN
from qflsd_ros.core.detection.region import Region

SINE = math.sin(math.radians(11.25))
NOISE_ALIGNED = 1.5                     # standard deviations of noise more
# Of alignment: at least, as photographs are told best from texture, and more in busy surroundings.
CHANCE, CHANCE_BUSY = 0.08, 0.5
BUSY = 0.5                              # of an arc's contrast: what is strong in its surroundings
BESIDE = (-8.0, -4.0, 4.0, 8.0)         # px from the arc, where surroundings are looked at
EVERY = 8               # edge points from one look to the next
JITTER = 1.0            # px by which noise as strong as the contrast moves a point
SCATTER = 0.43          # of the tolerance: rms distance of an accident's points from its arc
EXACT = 0.5             # of that: rms distance from which on less does not say more
INDEPENDENT = 0.5       # share of the points whose distances do not follow from their neighbours'


# What speaks for a piece of an arc: columns of an array (M, WITNESSES) float64.  The weight of all
# its points, and of the aligned ones; the sum of the steps across in grey levels; the points where
# P grows with the grey level, less the rest; the places beside the arc that were looked at, and
# those that are strong.
WEIGHT, ALIGNED, STEPS, SIGNS, LOOKS, STRONG, WITNESSES = range(7)


class Evidence(NamedTuple):
    """What an arc is compared with."""

    points: np.ndarray      # (4, E) float32, as :func:`edges.locate` leaves them
    dx: np.ndarray          # (H, W) int16 gradients
    dy: np.ndarray
    clear: float            # how strong a gradient is that counts half, grey levels
    noise: float            # standard deviation of dx and dy, grey levels
    region: Region          # where arcs may be
    blur: float             # standard deviation of the Gaussian before dx and dy, px


@summed
def _support(fits: np.ndarray, i: int, points: np.ndarray, first: int, last: int, clear: float,
             noise: float, found: np.ndarray) -> None:
    """Compare the gradients at edge points ``first`` to ``last`` with the normal of fit i."""
    ox, oy, a, b, c = fits[i, 0], fits[i, 1], fits[i, 2], fits[i, 3], fits[i, 4]
    total, aligned, steps, signs = 0.0, 0.0, 0.0, 0.0
    for k in range(first, last + 1):
        gx, gy = points[2, k], points[3, k]
        nx, ny = 2 * a * (points[0, k] - ox) + b, 2 * a * (points[1, k] - oy) + c
        across, along = gx * nx + gy * ny, gx * ny - gy * nx
        # With s = 1 / (m + c) a gradient m has the weight m / (m + c) = 1 - c s.
        s = 1 / (math.sqrt(gx * gx + gy * gy) + np.float32(clear))
        weight = 1 - clear * s
        most = SINE * weight + NOISE_ALIGNED * noise * s
        weight = weight if most < weight else 0.0  # type: ignore[assignment]
        total += weight  # type: ignore[assignment]
        aligned += weight if abs(along) * s < most else 0.0  # type: ignore[assignment]
        steps += abs(across)
        signs += math.copysign(1.0, across)
    found[i, WEIGHT], found[i, ALIGNED] = total, aligned
    found[i, STEPS], found[i, SIGNS] = steps, signs


@inlined
def _surroundings(fits: np.ndarray, i: int, points: np.ndarray, first: int, last: int,
                  dx: np.ndarray, dy: np.ndarray, where: Region, strong: float,
                  found: np.ndarray) -> None:
    """Count the places seen beside edge points ``first`` to ``last``, and the strong of them."""
    height, width = dx.shape
    least = int((SOBEL_GAIN * strong) ** 2)
    looks = hits = 0
    for k in range(first, last + 1, EVERY):
        x, y = float(points[0, k]), float(points[1, k])
        nx = 2 * fits[i, 2] * (x - fits[i, 0]) + fits[i, 3]
        ny = 2 * fits[i, 2] * (y - fits[i, 1]) + fits[i, 4]
        for offset in BESIDE:
            column = min(max(int(x + offset * nx + 0.5), 0), width - 1)
            row = min(max(int(y + offset * ny + 0.5), 0), height - 1)
            if where.masked and not where.seen[row, column]:
                continue
            gx, gy = int(dx[row, column]), int(dy[row, column])
            looks += 1
            hits += gx * gx + gy * gy > least
    found[i, LOOKS], found[i, STRONG] = looks, hits


@compiled
def witness(evidence: Evidence, runs: np.ndarray, fits: np.ndarray, wanted: np.ndarray,
            found: np.ndarray) -> None:
    """
    Find what speaks for each piece of an arc that is wanted.

    Parameters
    ----------
    evidence
        Of the image.
    runs, fits
        (M, 2) and (M, FIT_SIZE), as :func:`extraction.extract` leaves them.
    wanted
        (M,) bool, the pieces to look at.
    found
        (M, WITNESSES) float64, takes what is found.

    """
    points, dx, dy, clear, noise, where, _ = evidence
    for i in range(len(runs)):
        if wanted[i]:
            first, last = runs[i, 0], runs[i, 1]
            _support(fits, i, points, first, last, clear, noise, found)
            strong = BUSY * found[i, STEPS] / (last + 1 - first)
            _surroundings(fits, i, points, first, last, dx, dy, where, strong, found)


@compiled
def closeness(points: float, rms: float, noise: float, tolerance: float) -> float:
    """
    Return what it adds to the score that so many points lie within such an rms distance, px.

    Of m independent distances the share ``(rms / scatter)^m`` of all that are to be expected is as
    small: the volume of a ball in m dimensions.  Noise, given as a share of the contrast, is not
    held against the arc; nor do points tell anything that it moves as far as that scatter.
    """
    scatter, jitter = SCATTER * tolerance, JITTER * noise
    least = min(max(EXACT * scatter, jitter), scatter)
    square = max(rms * rms - jitter * jitter, least * least)
    return -0.5 * INDEPENDENT * points * math.log10(square / (scatter * scatter))


@compiled
def score(n: float, k: float, busy: float, candidates: int) -> float:
    """
    Return -log10 of the number of false alarms (NFA) of independent points.

    ``n`` and ``k`` are the weights of all and of the aligned points, ``busy`` is the share of
    strong places in the surroundings; the binomial tail is taken by Hoeffding's bound.
    """
    share, chance = k / n if n > 0 else 0.0, CHANCE + CHANCE_BUSY * busy
    surprise = 0.0
    if share > chance:
        surprise = share * math.log10(share / chance)
        if share < 1:
            surprise += (1 - share) * math.log10((1 - share) / (1 - chance))
    return n * surprise - math.log10(candidates)
