"""
Joining: one arc from several pieces, across junctions, gaps, occlusions and flips of polarity.

Three points represent a piece: the nodes of Gauss-Legendre quadrature on its fit, with its edge
points distributed to them by the weights of the quadrature.  They have the same moments up to the
fifth order as the edge points, so that the least squares of a joined arc over the nodes of its
pieces is that over all its edge points, at a cost that does not depend on their number.

All pairs of ends that face each other are candidates.  The cheapest pair of the image is joined
first; the two outer ends of the new arc then look for partners again.  The result does not depend
on the order of the pieces.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.circle import FIT_SIZE
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.edges import GAIN
from qflsd_ros.core.detection.frame import Frame, Limits
from qflsd_ros.core.detection.grid import cell, gap_to, Grid, OVERLAP, sort_ends
from qflsd_ros.core.detection.heap import Heap, ITEM, pop, push
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
FLIP_COST = 30.0        # px of gap that weigh as much as a change of polarity
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
    """N arcs, each a sequence of pieces in order of travel."""

    members: np.ndarray     # (M, 2) int64: piece, and 1 where it is travelled from end to start
    offsets: np.ndarray     # (N + 1,) int64: where in members each arc begins
    fits: np.ndarray        # (N, FIT_SIZE) float64


class Arcs(NamedTuple):
    """The arcs during joining, up to M; an end is 2 piece + side."""

    mate: np.ndarray        # (2 M,) int64: the end that an end is joined to; itself if to none
    arc: np.ndarray         # (2 M,) int64: the arc of an outer end
    outer: np.ndarray       # (M, 2) int64: the two outer ends of an arc
    stamp: np.ndarray       # (M,) int64: changes when the arc does
    sums: np.ndarray        # (M, 3) float64: as in Pieces, and the gaps in its length
    fits: np.ndarray        # (M, FIT_SIZE) float64


class Trial(NamedTuple):
    """Memory for one pair of arcs."""

    nodes: np.ndarray       # (3, NODES M) float64: x, y and weight of the nodes, in order
    fit: np.ndarray         # (1, FIT_SIZE) float64


class Scene(NamedTuple):
    """All that joining works on."""

    pieces: Pieces
    grid: Grid
    arcs: Arcs
    trial: Trial
    heap: Heap
    frame: Frame


class Memory:
    """Memory to join up to ``most`` pieces, kept from frame to frame."""

    def __init__(self, most: int) -> None:
        self.ends, self.nodes = np.empty((2 * most, 4)), np.empty((most, NODES, 2))
        self.sums = np.empty((most, 3))
        self.order, self.places = np.empty(2 * most, np.int64), np.empty((2 * most, 4))
        self.arcs = Arcs(np.empty(2 * most, np.int64), np.empty(2 * most, np.int64),
                         np.empty((most, 2), np.int64), np.empty(most, np.int64),
                         np.empty((most, 3)), np.empty((most, FIT_SIZE)))
        self.trial = Trial(np.empty((3, NODES * most)), np.empty((1, FIT_SIZE)))
        # Each end is once in the heap, and the outer ends of each joined arc again.
        self.heap = Heap(np.empty(4 * most), np.empty((4 * most, ITEM), np.int64),
                         np.zeros(1, np.int64))
        self.members, self.offsets = np.empty((most, 2), np.int64), np.empty(most + 1, np.int64)
        self.fits = np.empty((most, FIT_SIZE))


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
def _copy(source: np.ndarray, i: int, target: np.ndarray, j: int) -> None:
    """Copy row i of one array to row j of another."""
    for column in range(source.shape[1]):
        target[j, column] = source[i, column]


@inlined
def _append(scene: Scene, end: int, outward: bool, n: int) -> int:
    """
    Write the nodes of an arc to the trial, from column n on; return the new n.

    The arc is travelled to the outer ``end``, or from it if not ``outward``.
    """
    pieces, nodes, mate = scene.pieces, scene.trial.nodes, scene.arcs.mate
    outer = scene.arcs.outer[scene.arcs.arc[end]]
    e = end
    if outward:
        e = outer[1] if outer[0] == end else outer[0]
    while True:
        piece, side = e // 2, e % 2
        for k in range(NODES):
            j = k if side == 0 else NODES - 1 - k
            nodes[0, n + k] = pieces.nodes[piece, j, 0]
            nodes[1, n + k] = pieces.nodes[piece, j, 1]
            nodes[2, n + k] = NODE_WEIGHT[k] * pieces.sums[piece, COUNT]
        n += NODES
        far = 2 * piece + 1 - side
        if mate[far] == far:
            return n
        e = mate[far]


@inlined
def _farthest(fits: np.ndarray, which: int, nodes: np.ndarray, first: int, last: int) -> float:
    """Return the largest distance of nodes first to last - 1 from a fit, px."""
    farthest = 0.0
    for k in range(first, last):
        farthest = max(farthest, abs(circle.value_at(fits, which, nodes[0, k], nodes[1, k])))
    return farthest


@compiled
def _evidence(scene: Scene, e: int, f: int) -> float:
    """
    Return how much the gradients in the gap between two ends support the joined arc, -1 to 1.

    It is the share of the pixels whose gradient is normal to the arc and has the polarity of the
    ends, less the share of those with the opposite polarity.  Between ends of different polarity,
    either polarity counts.  It is -1 if a pixel is masked.
    """
    ends, fit, frame = scene.pieces.ends, scene.trial.fit, scene.frame
    x0, y0, x1, y1 = ends[e, 0], ends[e, 1], ends[f, 0], ends[f, 1]
    steps = max(2, int(math.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)))
    step_x, step_y = (x1 - x0) / steps, (y1 - y0) / steps
    votes = 0
    for i in range(1, steps):
        x, y = x0 + i * step_x, y0 + i * step_y
        nx, ny = circle.normal_at(fit, 0, x, y)
        off = circle.value_at(fit, 0, x, y)
        row = min(max(int(y - off * ny + 0.5), 0), frame.dx.shape[0] - 1)
        column = min(max(int(x - off * nx + 0.5), 0), frame.dx.shape[1] - 1)
        if frame.region.masked and not frame.region.seen[row, column]:
            return -1.0
        gx, gy = float(frame.dx[row, column]), float(frame.dy[row, column])
        across, square = gx * nx + gy * ny, gx * gx + gy * gy
        aligned = across * across > ALIGNED ** 2 * square
        # The brighter side is on the right of a piece, which is travelled from start to end.
        right = nx * step_y < ny * step_x
        votes += ((aligned & (square > (GAIN * FAINTEST) ** 2))
                  * (1 if (across > 0) == right else -1))
    share = votes / (steps - 1)
    if e % 2 == f % 2:
        return abs(share)
    return share if e % 2 == 1 else -share


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
def _bends(arcs: Arcs, a: int, b: int, gap: float, trial: Trial, limits: Limits) -> bool:
    """Return whether two arcs are images of lines, but not of the same line."""
    whole = arcs.sums[a, SIZE] + gap + arcs.sums[b, SIZE]
    return (circle.is_known(limits.bend.lens) and not _is_straight(trial.fit, 0, whole, limits)
            and _is_straight(arcs.fits, a, arcs.sums[a, SIZE], limits)
            and _is_straight(arcs.fits, b, arcs.sums[b, SIZE], limits))


@inlined
def _misfit(sums: np.ndarray, a: int, b: int, rss: float) -> tuple[float, float]:
    """
    Return the rms distance of the smaller of two arcs from the joined one, and its limit, px.

    ``rss`` is the residual sum of squares of the joined arc.
    """
    residual = sums[a, RSS] + sums[b, RSS]
    fewer = min(sums[a, COUNT], sums[b, COUNT])
    more = max(0.0, rss - residual)
    imperfect = MISFIT + MISFIT_SHARE * max(sums[a, SIZE], sums[b, SIZE])
    variance = residual / (sums[a, COUNT] + sums[b, COUNT]) / fewer
    return (math.sqrt(more / fewer),
            math.sqrt(imperfect * imperfect + MISFIT_BY_NOISE ** 2 * variance))


@compiled
def _cost(scene: Scene, e: int, f: int, gap: float, limits: Limits) -> float:
    """Return the cost of joining two outer ends, px, or inf; leaves the fit in the trial."""
    arcs, trial = scene.arcs, scene.trial
    a, b = arcs.arc[e], arcs.arc[f]
    middle = _append(scene, e, True, 0)
    n = _append(scene, f, False, middle)
    a_longer = arcs.sums[a, SIZE] >= arcs.sums[b, SIZE]
    longer, shorter = (a, b) if a_longer else (b, a)
    # The extrapolation of the longer arc becomes uncertain with the distance.
    lever = 1 + (gap + arcs.sums[shorter, SIZE]) / arcs.sums[longer, SIZE]
    off = LEEWAY * limits.tolerance
    first, last = (middle, n) if a_longer else (0, middle)
    if _farthest(arcs.fits, longer, trial.nodes, first, last) > off * (1 + 2 * lever * lever):
        return np.inf
    residual = arcs.sums[a, RSS] + arcs.sums[b, RSS]
    if not circle.fit(trial.nodes, (0, n - 1), residual, limits.bend, trial.fit, 0):
        return np.inf
    whole = arcs.sums[a, SIZE] + gap + arcs.sums[b, SIZE]
    rss = trial.fit[0, circle.RSS]
    if (2 * abs(trial.fit[0, circle.A]) * whole > MAX_TURN
            or rss > limits.tolerance ** 2 * trial.fit[0, circle.COUNT]):
        return np.inf
    misfit, most = _misfit(arcs.sums, a, b, rss)
    if (misfit > most or _farthest(trial.fit, 0, trial.nodes, 0, n) > off
            or _bends(arcs, a, b, gap, trial, limits)):
        return np.inf
    return gap + MISFIT_COST * misfit + (FLIP_COST if e % 2 == f % 2 else 0.0)


@inlined
def _needed(arcs: Arcs, a: int, b: int, gap: float, trial: Trial, limits: Limits) -> float:
    """Return the evidence that a gap, px, between two arcs needs."""
    if gap <= FREE:
        return 0.0
    shorter = min(arcs.sums[a, SIZE], arcs.sums[b, SIZE])
    needed = max(0.0, min(EVIDENCE, EVIDENCE_SLOPE * (gap / shorter - FREE_SHARE)))
    whole = arcs.sums[a, SIZE] + gap + arcs.sums[b, SIZE]
    if circle.is_known(limits.bend.lens) and _is_straight(trial.fit, 0, whole, limits):
        return EASE * needed
    return needed


@inlined
def _tip(scene: Scene, e: int) -> tuple[float, float, float, float]:
    """Return an outer end of an arc, and its outward tangent."""
    ends, arcs, a = scene.pieces.ends, scene.arcs, scene.arcs.arc[e]
    if arcs.outer[a, 0] // 2 == arcs.outer[a, 1] // 2:
        return ends[e, 0], ends[e, 1], ends[e, 2], ends[e, 3]
    x, y, tx, ty = circle.foot(arcs.fits, a, ends[e, 0], ends[e, 1])
    if tx * ends[e, 2] + ty * ends[e, 3] < 0:
        return x, y, -tx, -ty
    return x, y, tx, ty


@compiled
def _partner(scene: Scene, e: int, limits: Limits) -> tuple[int, float]:
    """Return the cheapest end to join an outer end to, or -1, and the cost."""
    arcs, grid = scene.arcs, scene.grid
    a = arcs.arc[e]
    size, single = arcs.sums[a, SIZE], arcs.outer[a, 0] // 2 == arcs.outer[a, 1] // 2
    # The longer one of two pieces evaluates the pair.
    reach = min(limits.max_gap, 2 * GAP_SHARE * size) if single else limits.max_gap
    tip = _tip(scene, e)
    x, y, tx, ty = tip
    left = cell(min(x, x + reach * tx) - OVERLAP, grid.columns)
    right = cell(max(x, x + reach * tx) + OVERLAP, grid.columns)
    best, best_cost = -1, np.inf
    for r in range(cell(min(y, y + reach * ty) - OVERLAP, grid.rows),
                   cell(max(y, y + reach * ty) + OVERLAP, grid.rows) + 1):
        row = r * grid.columns
        for k in range(grid.begins[row + left], grid.begins[row + right + 1]):
            f = grid.order[k]
            gap = gap_to(tip, grid, k, min(reach, best_cost))
            if gap == np.inf or arcs.mate[f] != f or arcs.arc[f] == a:
                continue
            other = arcs.sums[arcs.arc[f], SIZE]
            if gap > GAP_SHARE * (size + other) or (single and other > size):
                continue
            cost = _cost(scene, e, f, gap, limits)
            if cost >= best_cost:
                continue
            if _evidence(scene, e, f) >= _needed(arcs, a, arcs.arc[f], gap, scene.trial, limits):
                best, best_cost = f, cost
    return best, best_cost


@inlined
def _queue(scene: Scene, e: int, limits: Limits) -> None:
    """Add the cheapest pair of an outer end to the heap."""
    f, cost = _partner(scene, e, limits)
    if f >= 0:
        arcs = scene.arcs
        push(scene.heap, cost, (e, f, arcs.stamp[arcs.arc[e]], arcs.stamp[arcs.arc[f]]))


@inlined
def _merge(scene: Scene, e: int, f: int, stamp: int, limits: Limits) -> int:
    """Join two outer ends; return the arc, which is the first one, with a new stamp."""
    arcs, trial = scene.arcs, scene.trial
    a, b = arcs.arc[e], arcs.arc[f]
    n = _append(scene, f, False, _append(scene, e, True, 0))
    ends = scene.pieces.ends
    gap = math.hypot(ends[e, 0] - ends[f, 0], ends[e, 1] - ends[f, 1])
    for k in range(3):
        arcs.sums[a, k] += arcs.sums[b, k]
    arcs.sums[a, SIZE] += gap
    circle.fit(trial.nodes, (0, n - 1), arcs.sums[a, RSS], limits.bend, arcs.fits, a)
    first = arcs.outer[a, 1] if arcs.outer[a, 0] == e else arcs.outer[a, 0]
    last = arcs.outer[b, 1] if arcs.outer[b, 0] == f else arcs.outer[b, 0]
    arcs.mate[e], arcs.mate[f] = f, e
    arcs.outer[a, 0], arcs.outer[a, 1] = first, last
    arcs.arc[first] = arcs.arc[last] = a
    arcs.stamp[a] = stamp
    return a


@inlined
def _begin(scene: Scene, limits: Limits) -> None:
    """Let each piece be an arc."""
    pieces, arcs, trial = scene.pieces, scene.arcs, scene.trial
    for i in range(len(pieces.sums)):
        for side in range(2):
            e = 2 * i + side
            arcs.mate[e], arcs.arc[e], arcs.outer[i, side] = e, i, e
        arcs.stamp[i] = i
        _copy(pieces.sums, i, arcs.sums, i)
        _copy(pieces.fits, i, arcs.fits, i)
        if circle.is_known(limits.bend.lens):
            # As the lens bends it, unless its points are too far from that.
            n = _append(scene, 2 * i, False, 0)
            if (circle.fit(trial.nodes, (0, n - 1), arcs.sums[i, RSS], limits.bend, trial.fit, 0)
                    and trial.fit[0, circle.RSS]
                    <= limits.tolerance ** 2 * trial.fit[0, circle.COUNT]):
                _copy(trial.fit, 0, arcs.fits, i)


@compiled
def _join(scene: Scene, limits: Limits) -> None:
    """Join pairs of ends, the cheapest first, until no pair is left."""
    arcs, heap = scene.arcs, scene.heap
    _begin(scene, limits)
    heap.size[0] = 0
    if limits.max_gap == 0:
        return
    count = len(scene.pieces.sums)
    for i in range(count):
        if arcs.sums[i, SIZE] >= limits.min_seed:
            _queue(scene, 2 * i, limits)
            _queue(scene, 2 * i + 1, limits)
    stamp = count
    while heap.size[0] > 0:
        e, f, stamp_e, stamp_f = pop(heap)
        if arcs.mate[e] != e or arcs.stamp[arcs.arc[e]] != stamp_e:
            continue
        if arcs.mate[f] != f or arcs.stamp[arcs.arc[f]] != stamp_f:
            _queue(scene, e, limits)
            continue
        a = _merge(scene, e, f, stamp, limits)
        stamp += 1
        _queue(scene, arcs.outer[a, 0], limits)
        _queue(scene, arcs.outer[a, 1], limits)


@compiled
def _list(arcs: Arcs, order: np.ndarray, members: np.ndarray, offsets: np.ndarray,
          fits: np.ndarray) -> None:
    """Write the pieces of arcs in order, where each begins, and their fits."""
    n = 0
    offsets[0] = 0
    for i, a in enumerate(order):
        e = arcs.outer[a, 0]
        while True:
            members[n, 0], members[n, 1] = e // 2, e % 2
            n += 1
            far = e + 1 - 2 * (e % 2)
            if arcs.mate[far] == far:
                break
            e = arcs.mate[far]
        offsets[i + 1] = n
        _copy(arcs.fits, a, fits, i)


@compiled
def _is_arc(arcs: Arcs, min_seed: float, wanted: np.ndarray) -> None:
    """Mark the arcs that are long enough and have not become part of others."""
    for a in range(len(wanted)):
        e = arcs.outer[a, 0]
        wanted[a] = (arcs.mate[e] == e and arcs.arc[e] == a
                     and arcs.sums[a, SIZE] >= min_seed)


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
    scene = Scene(pieces, grid, memory.arcs, memory.trial, memory.heap, frame)
    _join(scene, limits)
    wanted = np.empty(m, np.bool_)
    _is_arc(memory.arcs, limits.min_seed, wanted)
    order = longest_first(memory.arcs.sums[:m, SIZE], wanted)
    _list(memory.arcs, order, memory.members, memory.offsets, memory.fits)
    return Joined(memory.members, memory.offsets[:len(order) + 1], memory.fits[:len(order)])
