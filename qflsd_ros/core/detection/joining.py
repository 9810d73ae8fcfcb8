"""
One arc from several pieces: across junctions, gaps, occlusions and flips of polarity.

A piece is stood for by three points on its fit, at the nodes of Gauss-Legendre quadrature, with
its edge points shared out to them by the weights of the quadrature.  They have the same moments up
to the fifth order as the edge points themselves, so that the least squares of a joined arc over
its pieces' nodes is that over all its edge points, at a cost that does not depend on their number.

The longest piece comes first, is extended at both ends by the nearest piece that fits, again and
again, and is taken out; then the next longest.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.circle import FIT_SIZE
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.edges import SOBEL_GAIN
from qflsd_ros.core.detection.frame import Frame, Limits
from qflsd_ros.core.detection.grid import cell, gap_to, Grid, OVERLAP, sort_ends
from qflsd_ros.core.detection.order import longest_first

NODES = 3
COUNT, RSS, SIZE = range(3)     # columns of Pieces.sums, and of the same of an arc
NODE_AT = np.array([-math.sqrt(0.6), 0.0, math.sqrt(0.6)])
NODE_WEIGHT = np.array([5.0, 8.0, 5.0]) / 18.0
GAP_SHARE = 0.7         # longest gap, of the sum of both lengths
# The rms distance by which the shorter piece may lie off the joined arc: px, and as much more for
# each px of the longer one, since edges and lenses are not perfect; standard deviations of its
# mean, which noise accounts for.
MISFIT, MISFIT_SHARE, MISFIT_BY_NOISE = 0.25, 0.004, 5.0
MAX_TURN = 3.0         # radians; the picture of a straight edge never turns by more than 3.14
LEEWAY = 1.8            # tolerances by which a node may lie off the joined arc
MISFIT_COST = 8.0       # px of gap that weigh as much as 1 px of misfit
ALIGNED = math.cos(math.radians(22.5))      # of the angle between gradient and normal in a gap
FAINTEST = 1.0          # grey levels, of a gradient that counts in a gap
FREE = 8.0              # px, longest gap that needs no evidence
FREE_SHARE = 0.2        # the same as a share of the shorter piece
EVIDENCE_SLOPE = 0.3    # evidence needed for each length of the shorter piece beyond that
EVIDENCE = 0.55         # evidence that suffices for any gap
BOW = 0.25              # px, sagitta by which real edges are bent
BENT = 3.0              # standard deviations from which on an arc is no picture of a straight edge
EASE = 0.75             # share of the evidence that is needed for the picture of a straight edge


class Pieces(NamedTuple):
    """M arcs out of chains, as columns."""

    runs: np.ndarray        # (M, 2) int64, first and last edge point
    fits: np.ndarray        # (M, FIT_SIZE) float64
    # (2 M, 4) float64: x, y and outward unit tangent, at start and end of each piece in turn
    ends: np.ndarray
    nodes: np.ndarray       # (M, NODES, 2) float64, px
    sums: np.ndarray        # (M, 3) float64: edge points, residual sum of squares, length


class Joined(NamedTuple):
    """N arcs, each a row of pieces in order of travel."""

    members: np.ndarray     # (M, 2) int64: piece, and 1 where it is travelled from end to start
    offsets: np.ndarray     # (N + 1,) int64: where in members each arc begins
    fits: np.ndarray        # (N, FIT_SIZE) float64


class Making(NamedTuple):
    """The arc in the making: row ``arcs`` of the fits, and the row after it to try in."""

    nodes: np.ndarray       # (3, N) float64, x, y and weight of its pieces' nodes, in order
    total: np.ndarray       # (3,) float64, the sums of its pieces, and the gaps in its length
    fits: np.ndarray        # (N + 1, FIT_SIZE) float64


class Memory:
    """What is needed to join up to ``most`` pieces, kept from frame to frame."""

    def __init__(self, most: int) -> None:
        self.ends, self.nodes = np.empty((2 * most, 4)), np.empty((most, NODES, 2))
        self.sums, self.taken = np.empty((most, 3)), np.empty(most, np.bool_)
        self.order, self.places = np.empty(2 * most, np.int64), np.empty((2 * most, 4))
        self.nodes_of_arc, self.total = np.empty((3, NODES * most)), np.empty(3)
        self.members, self.offsets = np.empty((most, 2), np.int64), np.empty(most + 1, np.int64)
        self.fits = np.empty((most + 1, FIT_SIZE))


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


def describe(points: np.ndarray, runs: np.ndarray, fits: np.ndarray, memory: Memory) -> Pieces:
    """Describe the arcs that :func:`extraction.extract` found for joining."""
    m = len(runs)
    pieces = Pieces(runs, fits, memory.ends[:2 * m], memory.nodes[:m], memory.sums[:m])
    _shapes(points, runs, fits, pieces.ends, pieces.nodes, pieces.sums)
    return pieces


@inlined
def _append(pieces: Pieces, piece: int, side: int, arc: Making, n: int) -> int:
    """Write the nodes of a piece, from its given side on, to columns n on; return the new n."""
    for k in range(NODES):
        j = k if side == 0 else NODES - 1 - k
        arc.nodes[0, n + k] = pieces.nodes[piece, j, 0]
        arc.nodes[1, n + k] = pieces.nodes[piece, j, 1]
        arc.nodes[2, n + k] = NODE_WEIGHT[k] * pieces.sums[piece, COUNT]
    return n + NODES


@inlined
def _fit(arc: Making, n: int, residual: float, row: int, limits: Limits) -> bool:
    """Fit the first n nodes of an arc; see :func:`circle.fit`."""
    return circle.fit(arc.nodes, (0, n - 1), residual, limits.bend, arc.fits, row)


@inlined
def _farthest(arc: Making, which: int, first: int, last: int) -> float:
    """Return the largest distance of nodes first to last - 1 from a fit, px."""
    farthest, fits = 0.0, arc.fits
    for k in range(first, last):
        farthest = max(farthest, abs(circle.value_at(fits, which, arc.nodes[0, k],
                                                     arc.nodes[1, k])))
    return farthest


@compiled
def _evidence(fits: np.ndarray, which: int, x0: float, y0: float, x1: float, y1: float,
              frame: Frame) -> float:
    """
    Return how far the gradients in the gap between two ends speak for an edge there, 0 to 1.

    It is the share of the pixels whose gradient is at right angles to the arc and points to one
    side of it, less the share of those that point to the other; -1 where a pixel is not seen.
    """
    steps = max(2, int(math.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)))
    ox, oy, a, b, c, d = (fits[which, 0], fits[which, 1], fits[which, 2], fits[which, 3],
                          fits[which, 4], fits[which, 5])
    step_x, step_y = (x1 - x0) / steps, (y1 - y0) / steps
    votes = 0
    for i in range(1, steps):
        x, y = x0 + i * step_x - ox, y0 + i * step_y - oy
        nx, ny, off = 2 * a * x + b, 2 * a * y + c, circle.value((a, b, c, d), x, y)
        row = min(max(int(oy + y - off * ny + 0.5), 0), frame.dx.shape[0] - 1)
        column = min(max(int(ox + x - off * nx + 0.5), 0), frame.dx.shape[1] - 1)
        if frame.region.masked and not frame.region.seen[row, column]:
            return -1.0
        gx, gy = float(frame.dx[row, column]), float(frame.dy[row, column])
        across, square = gx * nx + gy * ny, gx * gx + gy * gy
        aligned = across * across > ALIGNED ** 2 * square
        votes += (aligned & (square > (SOBEL_GAIN * FAINTEST) ** 2)) * (1 if across > 0 else -1)
    return abs(votes) / (steps - 1)


@inlined
def _is_straight(fits: np.ndarray, i: int, length: float, limits: Limits) -> bool:
    """Tell whether a fit of such a length, px, may be the picture of a straight edge."""
    lam, x, y, std = limits.bend.lens
    dx, dy = x - fits[i, circle.X0], y - fits[i, circle.Y0]
    part = circle.at_centre(lam, dx, dy, fits[i, circle.B], fits[i, circle.C], fits[i, circle.D])
    by_lens = std * part / (1 - lam * (dx * dx + dy * dy))
    by_bow = 4 * BOW / (length * length)
    variance = fits[i, circle.VAR_A] + by_lens * by_lens + by_bow * by_bow
    return (fits[i, circle.A] - lam * part) ** 2 < BENT * BENT * variance


@inlined
def _bends(pieces: Pieces, other: int, gap: float, arc: Making, now: int, limits: Limits) -> bool:
    """Tell whether a piece and an arc, each of a straight edge, are not of one and the same."""
    size, whole = pieces.sums[other, SIZE], arc.total[SIZE] + gap + pieces.sums[other, SIZE]
    return (circle.is_known(limits.bend.lens) and not _is_straight(arc.fits, now + 1, whole, limits)
            and _is_straight(arc.fits, now, arc.total[SIZE], limits)
            and _is_straight(pieces.fits, other, size, limits))


@inlined
def _misfit(pieces: Pieces, other: int, residual: float, arc: Making,
            now: int) -> tuple[float, float]:
    """
    Return the rms distance of the shorter piece from the joined arc, and what it may be, px.

    ``residual`` is the sum of squares that arc and piece have by themselves.
    """
    fewer = min(arc.total[COUNT], pieces.sums[other, COUNT])
    more = max(0.0, arc.fits[now + 1, circle.RSS] - residual)
    imperfect = MISFIT + MISFIT_SHARE * arc.total[SIZE]
    variance = residual / (arc.total[COUNT] + pieces.sums[other, COUNT]) / fewer
    return (math.sqrt(more / fewer),
            math.sqrt(imperfect * imperfect + MISFIT_BY_NOISE ** 2 * variance))


@inlined
def _cost(pieces: Pieces, other: int, side: int, gap: float, arc: Making, n: int, now: int,
          limits: Limits) -> float:
    """Return what joining a piece to an arc costs, px, or inf; writes the fit behind the arc's."""
    k = _append(pieces, other, side, arc, n)
    size = pieces.sums[other, SIZE]
    # The farther a piece reaches beyond the arc so far, the less that says where it should be.
    lever = 1 + (gap + size) / arc.total[SIZE]
    off = LEEWAY * limits.tolerance
    if _farthest(arc, now, n, k) > off * (1 + 2 * lever * lever):
        return np.inf
    residual = arc.total[RSS] + pieces.sums[other, RSS]
    if not _fit(arc, k, residual, now + 1, limits):
        return np.inf
    if 2 * abs(arc.fits[now + 1, circle.A]) * (arc.total[SIZE] + gap + size) > MAX_TURN:
        return np.inf
    if arc.fits[now + 1, circle.RSS] > limits.tolerance ** 2 * arc.fits[now + 1, circle.COUNT]:
        return np.inf
    misfit, most = _misfit(pieces, other, residual, arc, now)
    if misfit > most or _farthest(arc, now + 1, 0, k) > off:
        return np.inf
    if _bends(pieces, other, gap, arc, now, limits):
        return np.inf
    return gap + MISFIT_COST * misfit


@inlined
def _needed(pieces: Pieces, other: int, gap: float, arc: Making, now: int,
            limits: Limits) -> float:
    """Return the evidence that the gap, px, between an arc and a piece needs."""
    if gap <= FREE:
        return 0.0
    size = pieces.sums[other, SIZE]
    shorter = min(size, arc.total[SIZE])
    needed = max(0.0, min(EVIDENCE, EVIDENCE_SLOPE * (gap / shorter - FREE_SHARE)))
    if circle.is_known(limits.bend.lens) and _is_straight(arc.fits, now + 1,
                                                   arc.total[SIZE] + gap + size, limits):
        return EASE * needed
    return needed


@inlined
def _partner(pieces: Pieces, grid: Grid, taken: np.ndarray, arc: Making, n: int, now: int,
             tip: tuple[float, float, float, float], limits: Limits, frame: Frame) -> tuple[int, float]:
    """Return the end (2 piece + side, or -1) that continues an arc best, and the gap to it."""
    size = arc.total[SIZE]
    reach = min(limits.max_gap, 2 * GAP_SHARE * size)
    x, y, tx, ty = tip
    left = cell(min(x, x + reach * tx) - OVERLAP, grid.columns)
    right = cell(max(x, x + reach * tx) + OVERLAP, grid.columns)
    best, best_gap, best_cost = -1, np.inf, np.inf
    for r in range(cell(min(y, y + reach * ty) - OVERLAP, grid.rows),
                   cell(max(y, y + reach * ty) + OVERLAP, grid.rows) + 1):
        row = r * grid.columns
        for k in range(grid.begins[row + left], grid.begins[row + right + 1]):
            gap = gap_to(tip, grid, k, min(reach, best_cost))
            if gap == np.inf:
                continue
            other = grid.order[k] // 2
            if taken[other] or gap > GAP_SHARE * (size + pieces.sums[other, SIZE]):
                continue
            cost = _cost(pieces, other, grid.order[k] % 2, gap, arc, n, now, limits)
            if cost >= best_cost:
                continue
            found = _evidence(arc.fits, now + 1, x, y, grid.places[k, 0], grid.places[k, 1],
                              frame)
            if found >= _needed(pieces, other, gap, arc, now, limits):
                best, best_gap, best_cost = grid.order[k], gap, cost
    return best, best_gap


@inlined
def _begin(pieces: Pieces, seed: int, arc: Making, now: int, limits: Limits) -> int:
    """Make an arc of one piece; return the number of its nodes."""
    n = _append(pieces, seed, 0, arc, 0)
    for k in range(3):
        arc.total[k] = pieces.sums[seed, k]
    for k in range(FIT_SIZE):
        arc.fits[now, k] = pieces.fits[seed, k]
    # As the lens bends it, unless its points lie too far off that.
    if (circle.is_known(limits.bend.lens) and _fit(arc, n, arc.total[RSS], now + 1, limits)
            and arc.fits[now + 1, circle.RSS] <= limits.tolerance ** 2 * arc.fits[now + 1, circle.COUNT]):
        for k in range(FIT_SIZE):
            arc.fits[now, k] = arc.fits[now + 1, k]
    return n


@inlined
def _take(pieces: Pieces, piece: int, side: int, gap: float, arc: Making, n: int, now: int,
          limits: Limits) -> int:
    """Add a piece, travelled from its given side on, to an arc; return the number of its nodes."""
    n = _append(pieces, piece, side, arc, n)
    for k in range(3):
        arc.total[k] += pieces.sums[piece, k]
    arc.total[SIZE] += gap
    _fit(arc, n, arc.total[RSS], now, limits)
    return n


@inlined
def _tip(ends: np.ndarray, e: int, fits: np.ndarray, now: int,
         alone: bool) -> tuple[float, float, float, float]:
    """Return the end of an arc, and its outward tangent, where the end e of a piece is."""
    if alone:
        return ends[e, 0], ends[e, 1], ends[e, 2], ends[e, 3]
    x, y, tx, ty = circle.foot(fits, now, ends[e, 0], ends[e, 1])
    if tx * ends[e, 2] + ty * ends[e, 3] < 0:
        return x, y, -tx, -ty
    return x, y, tx, ty


@inlined
def _turn_round(nodes: np.ndarray, n: int, members: np.ndarray, first: int, last: int) -> None:
    """Let an arc, made of ``members`` first to last, be travelled from its other end."""
    for k in range(n // 2):
        for row in range(3):
            nodes[row, k], nodes[row, n - 1 - k] = nodes[row, n - 1 - k], nodes[row, k]
    for k in range(first, last + 1):
        members[k, 1] = 1 - members[k, 1]
    while first < last:
        for column in range(2):
            members[first, column], members[last, column] = (
                members[last, column], members[first, column])
        first, last = first + 1, last - 1


@compiled
def _join(pieces: Pieces, grid: Grid, seeds: np.ndarray, taken: np.ndarray, arc: Making,
          limits: Limits, frame: Frame, members: np.ndarray,
          offsets: np.ndarray) -> int:
    """Write the pieces of each arc, and where they begin; return the number of arcs."""
    arcs = 0
    offsets[0] = 0
    for seed in seeds:
        if taken[seed]:
            continue
        taken[seed] = True
        first = placed = offsets[arcs]
        members[placed, 0], members[placed, 1] = seed, 0
        n = _begin(pieces, seed, arc, arcs, limits)
        for _ in range(2):
            while limits.max_gap > 0:
                outer = 2 * members[placed, 0] + 1 - members[placed, 1]
                tip = _tip(pieces.ends, outer, arc.fits, arcs, placed == first)
                best, gap = _partner(pieces, grid, taken, arc, n, arcs, tip, limits, frame)
                if best < 0:
                    break
                placed += 1
                members[placed, 0], members[placed, 1] = best // 2, best % 2
                taken[best // 2] = True
                n = _take(pieces, best // 2, best % 2, gap, arc, n, arcs, limits)
            _turn_round(arc.nodes, n, members, first, placed)
        arcs += 1
        offsets[arcs] = placed + 1
    return arcs


def join(pieces: Pieces, memory: Memory, frame: Frame, limits: Limits) -> Joined:
    """
    Join pieces to arcs; arcs of short pieces only are left out.

    Parameters
    ----------
    pieces, memory
        The pieces, and the memory in which :func:`describe` described them.
    frame
        The image: no arc is joined across masked pixels.
    limits
        Of the frame.

    """
    m = len(pieces.sums)
    grid = sort_ends(pieces.ends, memory.order[:2 * m], memory.places[:2 * m], *frame.dx.shape)
    lengths = pieces.sums[:, SIZE]
    seeds = longest_first(lengths, lengths >= limits.min_seed)
    memory.taken[:m] = False
    arc = Making(memory.nodes_of_arc, memory.total, memory.fits)
    arcs = _join(pieces, grid, seeds, memory.taken, arc, limits, frame, memory.members,
                 memory.offsets)
    return Joined(memory.members, memory.offsets[:arcs + 1], memory.fits[:arcs])
