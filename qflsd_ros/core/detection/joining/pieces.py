"""
Pieces of arcs, as joining uses them.

Three points represent a piece: the nodes of Gauss-Legendre quadrature on its fit, with its edge
points distributed to them by the weights of the quadrature.  They have the same moments up to the
fifth order as the edge points, so that the least squares of a joined arc over the nodes of its
pieces is that over all its edge points, at a cost that does not depend on their number.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.compilation import compiled, inlined

COUNT, RSS, SIZE = range(3)     # columns of Pieces.sums, and of the same of an arc
NODES = 3               # of a piece: Gauss-Legendre quadrature, exact for powers up to 5
NODE_AT = np.array([-math.sqrt(0.6), 0.0, math.sqrt(0.6)])
NODE_WEIGHT = np.array([5.0, 8.0, 5.0]) / 18.0


class Pieces(NamedTuple):
    """M arcs out of chains, as columns."""

    runs: np.ndarray        # (M, 2) int64, first and last edge point
    fits: np.ndarray        # (M, FIT_SIZE) float64
    # (2 M, 4) float64: x, y and outward unit tangent, at start and end of each piece in turn
    ends: np.ndarray
    nodes: np.ndarray       # (M, NODES, 2) float64, px
    sums: np.ndarray        # (M, 3) float64: edge points, residual sum of squares, length


class PieceMemory(NamedTuple):
    """Memory to describe up to M pieces, kept from frame to frame."""

    ends: np.ndarray        # (2 M, 4) float64
    nodes: np.ndarray       # (M, NODES, 2) float64
    sums: np.ndarray        # (M, 3) float64


def piece_memory(most: int) -> PieceMemory:
    """Return memory to describe up to ``most`` pieces."""
    return PieceMemory(np.empty((2 * most, 4)), np.empty((most, NODES, 2)), np.empty((most, 3)))


@inlined
def _end(fits: np.ndarray, which: int, x: float, y: float, ends: np.ndarray, e: int) -> None:
    """Write the foot of a point on a fitted curve, and the tangent there."""
    ends[e, 0], ends[e, 1], ends[e, 2], ends[e, 3] = circle.foot(fits, which, x, y)


@compiled
def _shapes(points: np.ndarray, runs: np.ndarray, fits: np.ndarray, ends: np.ndarray,
            nodes: np.ndarray, sums: np.ndarray) -> None:
    """Fill the columns of :class:`Pieces`."""
    for i in range(len(runs)):
        a, b = 2 * i, 2 * i + 1
        _end(fits, i, points[0, runs[i, 0]], points[1, runs[i, 0]], ends, a)
        _end(fits, i, points[0, runs[i, 1]], points[1, runs[i, 1]], ends, b)
        cx, cy = ends[b, 0] - ends[a, 0], ends[b, 1] - ends[a, 1]
        if ends[a, 2] * cx + ends[a, 3] * cy > 0:
            ends[a, 2], ends[a, 3] = -ends[a, 2], -ends[a, 3]
        if ends[b, 2] * cx + ends[b, 3] * cy < 0:
            ends[b, 2], ends[b, 3] = -ends[b, 2], -ends[b, 3]
        for k in range(NODES):
            share = 0.5 + 0.5 * NODE_AT[k]
            x, y, _, _ = circle.foot(fits, i, ends[a, 0] + share * cx, ends[a, 1] + share * cy)
            nodes[i, k, 0], nodes[i, k, 1] = x, y
        sums[i, COUNT], sums[i, RSS] = fits[i, circle.COUNT], fits[i, circle.RSS]
        _, _, _, sums[i, SIZE] = circle.arc_between(fits, i, ends[a, 0], ends[a, 1], ends[b, 0],
                                                    ends[b, 1])


def describe(points: np.ndarray, runs: np.ndarray, fits: np.ndarray,
             memory: PieceMemory) -> Pieces:
    """Describe the arcs that :func:`extraction.extract` found for joining."""
    m = len(runs)
    pieces = Pieces(runs, fits, memory.ends[:2 * m], memory.nodes[:m], memory.sums[:m])
    _shapes(points, runs, fits, pieces.ends, pieces.nodes, pieces.sums)
    return pieces
