"""
One arc from several pieces: across junctions, gaps, occlusions and flips of polarity.

A piece is stood for by three points on its fit, at the nodes of Gauss-Legendre quadrature, with its
edge points shared out to them by the weights of the quadrature.  They have the same moments up to
the fifth order as the edge points themselves, so that the least squares of a joined arc over its
pieces' nodes is that over all its edge points, at a cost that does not depend on their number.

The longest piece comes first, is extended at both ends by the nearest piece that fits, again and
again, and is taken out; then the next longest.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.circle import compiled, FIT_SIZE

NODES = 3
NODE_AT = np.array([-math.sqrt(0.6), 0.0, math.sqrt(0.6)])
NODE_WEIGHT = np.array([5.0, 8.0, 5.0]) / 18.0
CELL = 16.0             # px, of the grid in which ends are looked up
COSINE = math.cos(math.radians(12.0))       # of the angle between the tangents at a gap
OVERLAP = 4.0           # px by which two pieces may overlap
GAP_SHARE = 0.7         # longest gap, of the sum of both lengths
ALIGNED = math.cos(math.radians(22.5))      # of the angle between gradient and normal
FAINTEST = 1.0          # grey levels, of a gradient that counts in a gap
NODE_TOL = 1.5
FREE = 6.0
FREE_SHARE = 0.15
EVIDENCE = 0.5
EVIDENCE_SLOPE = 0.3
MISFIT_COST = 8.0
MISFIT = 0.6           # px, rms by which the shorter piece may lie off the joined arc


class Pieces(NamedTuple):
    """M arcs out of chains, as columns."""

    runs: np.ndarray        # (M, 2) int64, first and last edge point
    ends: np.ndarray        # (M, 2, 4) float64: x, y, outward unit tangent at start and end
    nodes: np.ndarray       # (M, NODES, 2) float64, px
    counts: np.ndarray      # (M,) float64, number of edge points
    rss: np.ndarray         # (M,) float64, px^2, residual sum of squares
    sizes: np.ndarray       # (M,) float64, px, chord


class Joined(NamedTuple):
    """N arcs, each a row of pieces in order of travel."""

    members: np.ndarray     # (M, 2) int64: piece, and 1 where it is travelled from end to start
    offsets: np.ndarray     # (N + 1,) int64: where in members each arc begins
    fits: np.ndarray        # (N, FIT_SIZE) float64


@compiled
def foot(model: np.ndarray, x: float, y: float, out: np.ndarray) -> None:
    """Write the point of a fitted curve closest to (x, y), and the unit tangent there."""
    dx, dy = x - model[0], y - model[1]
    d = circle.distance((model[2], model[3], model[4], model[5]), dx, dy)
    gx, gy = 2 * model[2] * dx + model[3], 2 * model[2] * dy + model[4]
    size = math.sqrt(gx * gx + gy * gy)
    gx, gy = gx / size, gy / size
    out[0], out[1], out[2], out[3] = x - d * gx, y - d * gy, -gy, gx


@compiled
def _shape(model: np.ndarray, ends: np.ndarray, nodes: np.ndarray) -> float:
    """Turn the tangents of both ends outward, write the nodes between; return the chord, px."""
    cx, cy = ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1]
    for k in range(2):
        if (2 * k - 1) * (ends[k, 2] * cx + ends[k, 3] * cy) < 0:
            ends[k, 2], ends[k, 3] = -ends[k, 2], -ends[k, 3]
    at = np.empty(4)
    for k in range(NODES):
        share = 0.5 + 0.5 * NODE_AT[k]
        foot(model, ends[0, 0] + share * cx, ends[0, 1] + share * cy, at)
        nodes[k, 0], nodes[k, 1] = at[0], at[1]
    return math.sqrt(cx * cx + cy * cy)


@compiled
def pieces(px: np.ndarray, py: np.ndarray, runs: np.ndarray, fits: np.ndarray) -> Pieces:
    """Describe the arcs that :func:`extraction.extract` found for joining."""
    m = len(runs)
    ends, nodes, sizes = np.empty((m, 2, 4)), np.empty((m, NODES, 2)), np.empty(m)
    for i in range(m):
        for k in range(2):
            foot(fits[i], px[runs[i, k]], py[runs[i, k]], ends[i, k])
        sizes[i] = _shape(fits[i], ends[i], nodes[i])
    return Pieces(runs.copy(), ends, nodes, fits[:, 7].copy(), fits[:, 6].copy(), sizes)


@compiled
def _index(ends: np.ndarray, height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """
    Sort ends into square cells.

    Returns the first end of each cell, (rows, columns), and of each end the next, or -1.
    """
    columns, rows = int(width / CELL) + 1, int(height / CELL) + 1
    heads = np.full((rows, columns), -1, np.int64)
    chained = np.empty(2 * len(ends), np.int64)
    for piece in range(len(ends)):
        for k in range(2):
            r, c = _cell(ends[piece, k, 1], rows), _cell(ends[piece, k, 0], columns)
            chained[2 * piece + k] = heads[r, c]
            heads[r, c] = 2 * piece + k
    return heads, chained


@compiled
def _cell(coordinate: float, cells: int) -> int:
    return min(max(int(coordinate / CELL), 0), cells - 1)


@compiled
def _gap(a: np.ndarray, b: np.ndarray, longest: float) -> float:
    """Return the gap between two ends that may belong together, px, or inf."""
    gx, gy = b[0] - a[0], b[1] - a[1]
    gap = math.sqrt(gx * gx + gy * gy)
    along, across = gx * a[2] + gy * a[3], abs(gx * a[3] - gy * a[2])
    if (gap > longest or along < -OVERLAP or across > 1.5 + 0.25 * gap
            or a[2] * b[2] + a[3] * b[3] > -COSINE):
        return np.inf
    return gap


@compiled
def _append(pieces: Pieces, piece: int, side: int, nodes: np.ndarray, n: int) -> int:
    """Write the nodes of a piece, from its given side on, to rows n on of x, y, weight."""
    for k in range(NODES):
        j = k if side == 0 else NODES - 1 - k
        nodes[0, n + k], nodes[1, n + k] = pieces.nodes[piece, j, 0], pieces.nodes[piece, j, 1]
        nodes[2, n + k] = NODE_WEIGHT[k] * pieces.counts[piece]
    return n + NODES


@compiled
def _agrees(nodes: np.ndarray, n: int, fewer: float, tolerance: float, significance: float,
            sharpest: float, model: np.ndarray) -> bool:
    """Fit the first n nodes; is it one arc, from which none of its pieces departs?"""
    if not circle.fit(nodes[0], nodes[1], nodes[2], 0, n - 1, significance, sharpest,
                      model):
        return False
    if model[6] > MISFIT ** 2 * fewer:
        return False
    curve = (model[2], model[3], model[4], model[5])
    for k in range(n):
        if abs(circle.value(curve, nodes[0, k] - model[0], nodes[1, k] - model[1])) > NODE_TOL * tolerance:
            return False
    return True


@compiled
def _outward(model: np.ndarray, end: np.ndarray, out: np.ndarray) -> None:
    """Write the foot of an end on a curve, with the tangent that points the same way."""
    foot(model, end[0], end[1], out)
    if out[2] * end[2] + out[3] * end[3] < 0:
        out[2], out[3] = -out[2], -out[3]


@compiled
def _evidence(model: np.ndarray, a: np.ndarray, b: np.ndarray, dx: np.ndarray,
              dy: np.ndarray) -> float:
    """
    Return how far the gradients in the gap between two ends speak for an edge there, 0 to 1.

    It is the share of the pixels whose gradient is at right angles to the arc and points to one
    side of it, less the share of those that point to the other.
    """
    steps = max(2, int(math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)))
    at, votes = np.empty(4), 0
    for i in range(1, steps):
        foot(model, a[0] + (b[0] - a[0]) * i / steps, a[1] + (b[1] - a[1]) * i / steps, at)
        row = min(max(int(at[1] + 0.5), 0), dx.shape[0] - 1)
        column = min(max(int(at[0] + 0.5), 0), dx.shape[1] - 1)
        gx, gy = float(dx[row, column]), float(dy[row, column])
        across, size = gy * at[2] - gx * at[3], math.sqrt(gx * gx + gy * gy)
        if abs(across) > ALIGNED * size and size > 4 * FAINTEST:
            votes += 1 if across > 0 else -1
    return abs(votes) / (steps - 1)


@compiled
def _reverse(nodes: np.ndarray, n: int) -> None:
    for row in range(3):
        nodes[row, :n] = nodes[row, :n][::-1].copy()


@compiled
def join(pieces: Pieces, dx: np.ndarray, dy: np.ndarray, max_gap: float, tolerance: float,
         significance: float, sharpest: float) -> Joined:
    """
    Make arcs of pieces.

    Parameters
    ----------
    pieces
        What :func:`pieces` describes.
    height, width
        Size of the image, px.
    max_gap, tolerance
        As in :class:`Parameters`, px.
    significance, sharpest
        As in :func:`extraction.extract`.

    """
    m = len(pieces.sizes)
    height, width = dx.shape
    heads, chained = _index(pieces.ends, height, width)
    taken = np.zeros(m, np.bool_)
    members, offsets = np.empty((m, 2), np.int64), np.zeros(m + 1, np.int64)
    fits = np.empty((m, FIT_SIZE))
    nodes, model = np.empty((3, NODES * m)), np.empty(FIT_SIZE)
    arcs = placed = 0
    end, best_model = np.empty(4), np.empty(FIT_SIZE)
    for longest in np.argsort(-pieces.sizes, kind='mergesort'):
        if taken[longest]:
            continue
        taken[longest] = True
        first = placed
        members[placed, 0], members[placed, 1] = longest, 0
        placed += 1
        n = _append(pieces, longest, 0, nodes, 0)
        count, residual, size = pieces.counts[longest], pieces.rss[longest], pieces.sizes[longest]
        for way in range(2):
            piece, backward = members[placed - 1]
            end[:] = pieces.ends[piece, 1 - backward]
            if way == 1 and placed - first > 1:
                _outward(best_model, pieces.ends[piece, 1 - backward], end)
            while True:
                reach = max_gap
                x0, x1 = end[0], end[0] + reach * end[2]
                y0, y1 = end[1], end[1] + reach * end[3]
                best, best_gap, best_cost = -1, np.inf, np.inf
                for r in range(_cell(min(y0, y1) - OVERLAP, heads.shape[0]),
                               _cell(max(y0, y1) + OVERLAP, heads.shape[0]) + 1):
                    for c in range(_cell(min(x0, x1) - OVERLAP, heads.shape[1]),
                                   _cell(max(x0, x1) + OVERLAP, heads.shape[1]) + 1):
                        e = heads[r, c]
                        while e >= 0:
                            other, side = e // 2, e % 2
                            e = chained[e]
                            if taken[other]:
                                continue
                            limit = min(min(max_gap, best_cost),
                                        GAP_SHARE * (size + pieces.sizes[other]) + 3.0)
                            gap = _gap(end, pieces.ends[other, side], limit)
                            if gap >= best_cost:
                                continue
                            k = _append(pieces, other, side, nodes, n)
                            fewer = min(count, pieces.counts[other])
                            if not _agrees(nodes, k, fewer, tolerance,
                                           significance, sharpest, model):
                                continue
                            cost = gap + MISFIT_COST * math.sqrt(model[6] / fewer)
                            if cost >= best_cost:
                                continue
                            needed = min(EVIDENCE_SLOPE * (gap / min(size, pieces.sizes[other]) - FREE_SHARE), EVIDENCE)
                            if gap > FREE and needed > 0 and _evidence(model, end, pieces.ends[other, side], dx, dy) < needed:
                                continue
                            best, best_gap, best_cost = 2 * other + side, gap, cost
                            best_model[:] = model
                if best < 0:
                    break
                other, side = best // 2, best % 2
                n = _append(pieces, other, side, nodes, n)
                taken[other] = True
                members[placed, 0], members[placed, 1] = other, side
                placed += 1
                count += pieces.counts[other]
                residual += pieces.rss[other]
                size += pieces.sizes[other] + best_gap
                _outward(best_model, pieces.ends[other, 1 - side], end)
            _reverse(nodes, n)
            members[first:placed] = members[first:placed][::-1].copy()
            members[first:placed, 1] = 1 - members[first:placed, 1]
        circle.fit(nodes[0], nodes[1], nodes[2], 0, n - 1, significance, sharpest,
                   fits[arcs])
        fits[arcs, 6] += residual
        arcs += 1
        offsets[arcs] = placed
    return Joined(members, offsets[:arcs + 1], fits[:arcs])
