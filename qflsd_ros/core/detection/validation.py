"""
Validation: an arc is accepted if it is unlikely to arise by chance.

The test is a-contrario (Desolneux, Moisan and Morel 2000; LSD; EDLines).  In an image without the
arc, the gradient at each of its edge points would lie within 11.25 degrees of its normal, on
either side, by chance alone.  That probability is about 1/8 for random directions.  It is larger
in texture as strong as the arc itself, because edge points follow the contours there.  If k of n
points are aligned, the number of false alarms is the number of candidate arcs, times the
probability of k or more aligned points of n.

Points with a weak gradient have a lower weight, because noise dominates it.  The angle by which
noise turns a gradient is added to the limit of 11.25 degrees, and a point has no weight if noise
can turn its gradient by any angle.

The points of an accidental arc are also scattered over the width that the tolerance leaves them.
The probability that all distances from the arc are as small as observed is a second factor.

Both probabilities assume independent points.  Neighbours share pixels and blur, and the search
selects points that line up, so that the score orders arcs but is not a rate.  In images of noise
alone, each unit of the score divides the number of arcs by 1.5 (coarse noise) to 6 (white noise);
see benchmark/experiments/false_alarms.py.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.compilation import compiled, inlined, summed
from qflsd_ros.core.detection.contours.gradients import GAIN
from qflsd_ros.core.detection.frame import Frame

# All of these are chosen, not tuned, unless stated otherwise.
SINE = math.sin(math.radians(11.25))    # of the angle of alignment: that of EDLines
NOISE_ALIGNED = 1.5     # standard deviations of noise that are added to it
# Probability of alignment by chance: its least value, since photographs separate best from texture
# with it, and its rise with the share of strong gradients in the surroundings.
CHANCE, CHANCE_BUSY = 0.08, 0.5
BUSY = 0.5                              # contrast of a strong gradient nearby, as a share
BESIDE = (-8.0, -4.0, 4.0, 8.0)         # px from the arc, where the surroundings are sampled
EVERY = 8               # edge points between two samples of the surroundings
JITTER = 1.0            # px by which noise as strong as the contrast moves a point
SCATTER = 0.43          # rms distance of accidental points, as a share of the tolerance
EXACT = 0.5             # least rms distance that raises the score, as a share of the scatter
INDEPENDENT = 0.5       # share of the points whose distances are independent

# Columns of the gradient support of a piece, one row of a float64 array: the weight of all points,
# and of the aligned ones; the sum of the steps across, grey levels; the number of points where P
# grows with the grey level, less the others; the samples beside the arc, and the strong ones.
WEIGHT, ALIGNED, STEPS, SIGNS, SAMPLES, STRONG, SUPPORT_SIZE = range(7)


@summed
def _alignment(fits: np.ndarray, i: int, points: np.ndarray, span: tuple[int, int], frame: Frame,
               support: np.ndarray) -> None:
    """Compare the gradients at a span of edge points with the normal of fit i."""
    total, aligned, steps, signs = 0.0, 0.0, 0.0, 0.0
    for k in range(span[0], span[1] + 1):
        gx, gy = points[2, k], points[3, k]
        nx, ny = circle.normal_at(fits, i, points[0, k], points[1, k])
        across, along = gx * nx + gy * ny, gx * ny - gy * nx
        # With s = 1 / (m + c) a gradient m has the weight m / (m + c) = 1 - c s.
        s = 1 / (math.sqrt(gx * gx + gy * gy) + np.float32(frame.high))
        weight = 1 - frame.high * s
        most = SINE * weight + NOISE_ALIGNED * frame.noise * s
        weight = weight if most < weight else 0.0  # type: ignore[assignment]
        total += weight  # type: ignore[assignment]
        aligned += weight if abs(along) * s < most else 0.0  # type: ignore[assignment]
        steps += abs(across)
        signs += math.copysign(1.0, across)
    support[i, WEIGHT], support[i, ALIGNED] = total, aligned
    support[i, STEPS], support[i, SIGNS] = steps, signs


@inlined
def _surroundings(fits: np.ndarray, i: int, points: np.ndarray, span: tuple[int, int],
                  frame: Frame, support: np.ndarray) -> None:
    """Count the samples beside a span of edge points, and those with a strong gradient."""
    height, width = frame.dx.shape
    strong = BUSY * support[i, STEPS] / (span[1] + 1 - span[0])
    least = int((GAIN * strong) ** 2)
    samples = hits = 0
    for j in range(2 * ((span[1] - span[0]) // (2 * EVERY) + 1)):
        # From both ends on, so that the samples are the same whichever way the arc is travelled.
        k = span[0] + j // 2 * EVERY if j % 2 == 0 else span[1] - j // 2 * EVERY
        x, y = float(points[0, k]), float(points[1, k])
        nx, ny = circle.normal_at(fits, i, x, y)
        for offset in BESIDE:
            column = min(max(int(x + offset * nx + 0.5), 0), width - 1)
            row = min(max(int(y + offset * ny + 0.5), 0), height - 1)
            if frame.region.masked and not frame.region.seen[row, column]:
                continue
            gx, gy = int(frame.dx[row, column]), int(frame.dy[row, column])
            samples += 1
            hits += gx * gx + gy * gy > least
    support[i, SAMPLES], support[i, STRONG] = samples, hits


@compiled
def gradient_support(frame: Frame, points: np.ndarray, runs: np.ndarray, fits: np.ndarray,
                     wanted: np.ndarray, support: np.ndarray) -> None:
    """
    Measure how the gradients support the pieces that are wanted.

    Parameters
    ----------
    frame
        The image.
    points
        (4, E) float32, as :func:`edges.locate` leaves them.
    runs, fits
        (M, 2) and (M, FIT_SIZE), as :func:`extraction.extract` leaves them.
    wanted
        (M,) bool, the pieces to measure.
    support
        (M, SUPPORT_SIZE) float64, receives the support; rows of other pieces are left as they are.

    """
    for i in range(len(runs)):
        if wanted[i]:
            span = (runs[i, 0], runs[i, 1])
            _alignment(fits, i, points, span, frame, support)
            _surroundings(fits, i, points, span, frame, support)


@compiled
def closeness(points: float, rms: float, noise: float, tolerance: float) -> float:
    """
    Return the score of an rms distance, px, of a number of edge points from their arc.

    The probability that all of m independent distances, of a standard deviation ``scatter``, have
    an rms this small is about ``(rms / scatter)^m``, the volume of a ball in m dimensions.  The
    displacement by ``noise``, a share of the contrast, is subtracted from the rms; points that
    noise displaces by the scatter add nothing to the score.
    """
    scatter, jitter = SCATTER * tolerance, JITTER * noise
    least = min(max(EXACT * scatter, jitter), scatter)
    square = max(rms * rms - jitter * jitter, least * least)
    return -0.5 * INDEPENDENT * points * math.log10(square / (scatter * scatter))


@compiled
def score(n: float, k: float, busy: float, candidates: int) -> float:
    """
    Return -log10 of the number of false alarms (NFA), for independent points.

    ``n`` and ``k`` are the weights of all points and of the aligned points, and ``busy`` is the
    share of strong gradients in the surroundings.  Hoeffding's bound replaces the binomial tail.
    """
    share, chance = k / n if n > 0 else 0.0, CHANCE + CHANCE_BUSY * busy
    surprise = 0.0
    if share > chance:
        surprise = share * math.log10(share / chance)
        if share < 1:
            surprise += (1 - share) * math.log10((1 - share) / (1 - chance))
    return n * surprise - math.log10(candidates)
