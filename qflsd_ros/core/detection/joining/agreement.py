"""
Agreement: whether two arcs are parts of one, and what joining them costs.

A joined arc fits the nodes of both, turns by less than half a turn, and has gradients that support
it in the gap.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.contours.gradients import GAIN
from qflsd_ros.core.detection.frame import Frame, Limits
from qflsd_ros.core.detection.joining.grid import Grid
from qflsd_ros.core.detection.joining.heap import Heap
from qflsd_ros.core.detection.joining.pieces import COUNT, NODE_WEIGHT, NODES, Pieces, RSS, SIZE

# All of these are chosen, not tuned, unless stated otherwise.
# Largest rms distance of the shorter arc from the joined one: px, px per px of the longer arc,
# since edges and lenses are not perfect, and standard deviations of the mean of its points.
MISFIT, MISFIT_SHARE, MISFIT_BY_NOISE = 0.25, 0.004, 5.0
MAX_TURN = 3.0          # radians; the image of a line turns by less than pi
LEEWAY = 1.8            # distance of a node from the joined arc, in tolerances, at most
MISFIT_COST = 8.0       # px of gap that weigh as much as 1 px of misfit
FLIP_COST = 30.0        # px of gap that weigh as much as a change of polarity
ALIGNED = math.cos(math.radians(22.5))      # least cosine between gradient and normal in a gap
FAINTEST = 1.0          # grey levels, least gradient that counts in a gap
FREE = 8.0              # px, longest gap that needs no evidence
FREE_SHARE = 0.2        # longest such gap, as a share of the length of the shorter arc
EVIDENCE_SLOPE = 0.3    # needed evidence per such share beyond FREE_SHARE
EVIDENCE = 0.55         # evidence that suffices for any gap
BOW = 0.25              # px, sagitta of real edges in space
BENT = 3.0              # standard deviations of the curvature from the image of a line, at most
EASE = 0.75             # factor of the needed evidence for the image of a line


class Groups(NamedTuple):
    """The arcs during joining, up to M, each a group of pieces; an end is 2 piece + side."""

    mate: np.ndarray        # (2 M,) int64: the end that each end is joined to, or itself
    arc: np.ndarray         # (2 M,) int64: the arc of an outer end
    outer: np.ndarray       # (M, 2) int64: the two outer ends of an arc
    stamp: np.ndarray       # (M,) int64: a number that is new whenever the arc changes
    sums: np.ndarray        # (M, 3) float64: Pieces.sums of the arc, gaps in its length
    fits: np.ndarray        # (M, FIT_SIZE) float64


class Trial(NamedTuple):
    """Memory for the trial to join one pair of arcs."""

    nodes: np.ndarray       # (3, NODES M) float64: x, y and weight of the nodes, in order
    fit: np.ndarray         # (1, FIT_SIZE) float64


class Workspace(NamedTuple):
    """The arrays of :class:`Groups`, the pieces and the frame that joining works on."""

    pieces: Pieces
    grid: Grid
    groups: Groups
    trial: Trial
    heap: Heap
    frame: Frame


@inlined
def flip_cost(e: int, f: int) -> float:
    """Return the cost, px, of the change of polarity between two ends, if there is one."""
    return FLIP_COST if e % 2 == f % 2 else 0.0


@inlined
def append(work: Workspace, end: int, outward: bool, n: int) -> int:
    """
    Write the nodes of an arc to the trial, from column n on; return the new n.

    The arc is travelled to the outer ``end``, or from it if not ``outward``.
    """
    pieces, nodes, mate = work.pieces, work.trial.nodes, work.groups.mate
    outer = work.groups.outer[work.groups.arc[end]]
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
def evidence(work: Workspace, e: int, f: int) -> float:
    """
    Return how much the gradients in the gap between two ends support the joined arc, -1 to 1.

    It is the share of the pixels whose gradient is normal to the arc and has the polarity of the
    ends, less the share of those with the opposite polarity.  Between ends of different polarity,
    either polarity counts.  It is -1 if a pixel is masked.
    """
    ends, fit, frame = work.pieces.ends, work.trial.fit, work.frame
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
    """Return whether a fit of this length, px, may be the image of a straight edge."""
    lam, x, y, std = limits.bend.lens
    dx, dy = x - fits[i, circle.X0], y - fits[i, circle.Y0]
    part = circle.at_centre(lam, dx, dy, fits[i, circle.B], fits[i, circle.C], fits[i, circle.D])
    by_lens = std * part / (1 - lam * (dx * dx + dy * dy))
    by_bow = 4 * BOW / (length * length)
    variance = fits[i, circle.VAR_A] + by_lens * by_lens + by_bow * by_bow
    return (fits[i, circle.A] - lam * part) ** 2 < BENT * BENT * variance


@inlined
def _bends(groups: Groups, a: int, b: int, gap: float, trial: Trial, limits: Limits) -> bool:
    """Return whether two arcs are images of lines, but not of the same line."""
    whole = groups.sums[a, SIZE] + gap + groups.sums[b, SIZE]
    return (circle.is_known(limits.bend.lens) and not _is_straight(trial.fit, 0, whole, limits)
            and _is_straight(groups.fits, a, groups.sums[a, SIZE], limits)
            and _is_straight(groups.fits, b, groups.sums[b, SIZE], limits))


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
def cost(work: Workspace, e: int, f: int, gap: float, limits: Limits) -> float:
    """Return the cost of joining two outer ends, px, or inf; leaves the fit in the trial."""
    groups, trial = work.groups, work.trial
    a, b = groups.arc[e], groups.arc[f]
    middle = append(work, e, True, 0)
    n = append(work, f, False, middle)
    a_longer = groups.sums[a, SIZE] >= groups.sums[b, SIZE]
    longer, shorter = (a, b) if a_longer else (b, a)
    # The extrapolation of the longer arc becomes uncertain with the distance.
    lever = 1 + (gap + groups.sums[shorter, SIZE]) / groups.sums[longer, SIZE]
    off = LEEWAY * limits.tolerance
    first, last = (middle, n) if a_longer else (0, middle)
    if _farthest(groups.fits, longer, trial.nodes, first, last) > off * (1 + 2 * lever * lever):
        return np.inf
    residual = groups.sums[a, RSS] + groups.sums[b, RSS]
    if not circle.fit(trial.nodes, (0, n - 1), residual, limits.bend, trial.fit, 0):
        return np.inf
    whole = groups.sums[a, SIZE] + gap + groups.sums[b, SIZE]
    rss = trial.fit[0, circle.RSS]
    if (2 * abs(trial.fit[0, circle.A]) * whole > MAX_TURN
            or rss > limits.tolerance ** 2 * trial.fit[0, circle.COUNT]):
        return np.inf
    misfit, most = _misfit(groups.sums, a, b, rss)
    if (misfit > most or _farthest(trial.fit, 0, trial.nodes, 0, n) > off
            or _bends(groups, a, b, gap, trial, limits)):
        return np.inf
    return gap + flip_cost(e, f) + MISFIT_COST * misfit


@inlined
def needed(groups: Groups, a: int, b: int, gap: float, trial: Trial, limits: Limits) -> float:
    """Return the evidence that a gap, px, between two arcs needs."""
    if gap <= FREE:
        return 0.0
    shorter = min(groups.sums[a, SIZE], groups.sums[b, SIZE])
    needed = max(0.0, min(EVIDENCE, EVIDENCE_SLOPE * (gap / shorter - FREE_SHARE)))
    whole = groups.sums[a, SIZE] + gap + groups.sums[b, SIZE]
    if circle.is_known(limits.bend.lens) and _is_straight(trial.fit, 0, whole, limits):
        return EASE * needed
    return needed
