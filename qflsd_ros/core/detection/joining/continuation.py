"""
Continuation: whether two ends are an interruption of one edge, or end two edges.

Two edges that are almost in line, as the backs of books on different shelves, differ in two ways.
The fits of the pieces beside the gap, extrapolated to its middle, are a step apart that their
standard deviations do not explain, and the contrasts of the pieces differ.  Both are compared with
what one edge would show.  Chance brings more ends in line the longer a gap is, so that less of
either is allowed there.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.circle import CORRELATED, NOISE_FLOOR
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.joining.pieces import (
    COUNT, NODE_AT, NODE_WEIGHT, NODES, Pieces, RSS, SIZE)

# Standard deviations of a step, and natural logarithm of the ratio of contrasts, that alone refuse
# a gap of e px.  Tuned on the rendered room and half of the photographs: with 8.1 and 2.3, F stays
# the same within 0.001, fewer joins are false, and 1 % fewer bent lines are whole.
STEP, RATIO = 10.0, 2.8
# px, standard deviation of real edges from their arc; with 0.25 fewer false joins are refused.
IMPERFECT = 0.15
STRETCH = 24            # edge points at an end whose contrast is compared; chosen, not tuned
EVERY = 2               # edge points between two of these; chosen, not tuned


@inlined
def _reached(nodes: np.ndarray, fit: np.ndarray, first: int, way: int, gap: float) -> float:
    """
    Return the offset, px, from a fit that a piece has in the middle of a gap.

    The piece is the line through its offsets at the nodes ``first`` to ``first + NODES - 1``; the
    gap, a share of its length, lies behind its last node (``way`` 1) or before its first (-1).
    """
    mean = slope = 0.0
    for k in range(NODES):
        off = circle.value_at(fit, 0, nodes[0, first + k], nodes[1, first + k])
        mean += NODE_WEIGHT[k] * off
        slope += 3 * NODE_WEIGHT[k] * NODE_AT[k] * off
    return mean + way * slope * (1 + gap)


@inlined
def _spread(count: float, gap: float) -> float:
    """Return the variance of what :func:`_reached` returns, for points of a variance of 1."""
    return (1 + 3 * (1 + gap) ** 2) / count


@inlined
def _contrast(pieces: Pieces, e: int) -> float:
    """Return the mean gradient of a piece near its end e, grey levels."""
    first, last = pieces.runs[e // 2, 0], pieces.runs[e // 2, 1]
    points, total, number = pieces.points, 0.0, 0
    for away in range(0, min(STRETCH, last - first + 1), EVERY):
        i = first + away if e % 2 == 0 else last - away
        total += math.sqrt(points[2, i] * points[2, i] + points[3, i] * points[3, i])
        number += 1
    return total / number


@compiled
def doubt(pieces: Pieces, ends: tuple[int, int], gap: float, nodes: np.ndarray, middle: int,
          fit: np.ndarray) -> float:
    """
    Return how doubtful it is that two ends belong to one edge: above 1, they are not joined.

    Parameters
    ----------
    pieces, ends, gap
        The pieces, an end of one and of another (2 piece + side), and the gap between them, px.
    nodes, middle
        (3, N) nodes of the joined arc in order; those of the second end begin at ``middle``.
    fit
        (1, FIT_SIZE), the joined arc.

    """
    if gap <= 1:
        return 0.0
    e, f = ends
    sums, a, b = pieces.sums, e // 2, f // 2
    to_a, to_b = gap / sums[a, SIZE], gap / sums[b, SIZE]
    step = (_reached(nodes, fit, middle - NODES, 1, to_a)
            - _reached(nodes, fit, middle, -1, to_b))
    point = max((sums[a, RSS] + sums[b, RSS]) / (sums[a, COUNT] + sums[b, COUNT]),
                NOISE_FLOOR ** 2)
    spread = _spread(sums[a, COUNT], to_a) + _spread(sums[b, COUNT], to_b)
    variance = CORRELATED * point * spread + IMPERFECT ** 2
    ratio = math.log(_contrast(pieces, e) / _contrast(pieces, f))
    return (step * step / variance / STEP ** 2 + ratio * ratio / RATIO ** 2) * math.log(gap)
