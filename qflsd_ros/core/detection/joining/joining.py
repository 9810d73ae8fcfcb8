"""
Joining: one arc from several pieces, across junctions, gaps, occlusions and flips of polarity.

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
from qflsd_ros.core.detection.frame import Frame, Limits
from qflsd_ros.core.detection.joining.agreement import (
    append, cost, evidence, flip_cost, Groups, needed, Trial, Workspace)
from qflsd_ros.core.detection.joining.grid import cell, gap_to, OVERLAP, sort_ends
from qflsd_ros.core.detection.joining.heap import Heap, ITEM, pop, push
from qflsd_ros.core.detection.joining.pieces import NODES, Pieces, RSS, SIZE
from qflsd_ros.core.detection.order import longest_first

# All of these are chosen, not tuned, unless stated otherwise.
GAP_SHARE = 0.7         # longest gap, of the sum of both lengths


class Joined(NamedTuple):
    """N arcs, each a sequence of pieces in order of travel."""

    members: np.ndarray     # (M, 2) int64: piece, and 1 where it is travelled from end to start
    offsets: np.ndarray     # (N + 1,) int64: where in members each arc begins
    fits: np.ndarray        # (N, FIT_SIZE) float64


class Memory:
    """Memory to join up to ``most`` pieces, kept from frame to frame."""

    def __init__(self, most: int) -> None:
        self.order, self.places = np.empty(2 * most, np.int64), np.empty((2 * most, 4))
        self.groups = Groups(np.empty(2 * most, np.int64), np.empty(2 * most, np.int64),
                             np.empty((most, 2), np.int64), np.empty(most, np.int64),
                             np.empty((most, 3)), np.empty((most, FIT_SIZE)))
        self.trial = Trial(np.empty((3, NODES * most)), np.empty((1, FIT_SIZE)))
        # The heap receives each end once, and both outer ends of each joined arc once more.
        self.heap = Heap(np.empty(4 * most), np.empty((4 * most, ITEM), np.int64),
                         np.zeros(1, np.int64))
        self.members, self.offsets = np.empty((most, 2), np.int64), np.empty(most + 1, np.int64)
        self.fits = np.empty((most, FIT_SIZE))


@inlined
def _copy(source: np.ndarray, i: int, target: np.ndarray, j: int) -> None:
    """Copy row i of one array to row j of another."""
    for column in range(source.shape[1]):
        target[j, column] = source[i, column]


@inlined
def _tip(work: Workspace, e: int) -> tuple[float, float, float, float]:
    """Return an outer end of an arc, and its outward tangent."""
    ends, groups, a = work.pieces.ends, work.groups, work.groups.arc[e]
    if groups.outer[a, 0] // 2 == groups.outer[a, 1] // 2:
        return ends[e, 0], ends[e, 1], ends[e, 2], ends[e, 3]
    x, y, tx, ty = circle.foot(groups.fits, a, ends[e, 0], ends[e, 1])
    if tx * ends[e, 2] + ty * ends[e, 3] < 0:
        return x, y, -tx, -ty
    return x, y, tx, ty


@compiled
def _partner(work: Workspace, e: int, limits: Limits) -> tuple[int, float]:
    """Return the cheapest end to join an outer end to, or -1, and the cost."""
    groups, grid = work.groups, work.grid
    a = groups.arc[e]
    size, single = groups.sums[a, SIZE], groups.outer[a, 0] // 2 == groups.outer[a, 1] // 2
    # The longer one of two pieces evaluates the pair.
    reach = min(limits.max_gap, 2 * GAP_SHARE * size) if single else limits.max_gap
    tip = _tip(work, e)
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
            if gap == np.inf or groups.mate[f] != f or groups.arc[f] == a:
                continue
            other = groups.sums[groups.arc[f], SIZE]
            if gap > GAP_SHARE * (size + other) or (single and other > size):
                continue
            # The misfit, the rest of the cost, takes the most time and is left for the last.
            if gap + flip_cost(e, f) >= best_cost:
                continue
            price = cost(work, e, f, gap, limits)
            if price >= best_cost:
                continue
            if evidence(work, e, f) >= needed(groups, a, groups.arc[f], gap, work.trial, limits):
                best, best_cost = f, price
    return best, best_cost


@inlined
def _queue(work: Workspace, e: int, limits: Limits) -> None:
    """Add the cheapest pair of an outer end to the heap."""
    f, cost = _partner(work, e, limits)
    if f >= 0:
        groups = work.groups
        push(work.heap, cost, (e, f, groups.stamp[groups.arc[e]], groups.stamp[groups.arc[f]]))


@inlined
def _merge(work: Workspace, e: int, f: int, stamp: int, limits: Limits) -> int:
    """Join the arcs of two outer ends; return the first arc, which has a new stamp and is both."""
    groups, trial = work.groups, work.trial
    a, b = groups.arc[e], groups.arc[f]
    n = append(work, f, False, append(work, e, True, 0))
    ends = work.pieces.ends
    gap = math.hypot(ends[e, 0] - ends[f, 0], ends[e, 1] - ends[f, 1])
    for k in range(3):
        groups.sums[a, k] += groups.sums[b, k]
    groups.sums[a, SIZE] += gap
    circle.fit(trial.nodes, (0, n - 1), groups.sums[a, RSS], limits.bend, groups.fits, a)
    first = groups.outer[a, 1] if groups.outer[a, 0] == e else groups.outer[a, 0]
    last = groups.outer[b, 1] if groups.outer[b, 0] == f else groups.outer[b, 0]
    groups.mate[e], groups.mate[f] = f, e
    groups.outer[a, 0], groups.outer[a, 1] = first, last
    groups.arc[first] = groups.arc[last] = a
    groups.stamp[a] = stamp
    return a


@inlined
def _begin(work: Workspace, limits: Limits) -> None:
    """Make each piece an arc of its own."""
    pieces, groups, trial = work.pieces, work.groups, work.trial
    for i in range(len(pieces.sums)):
        for side in range(2):
            e = 2 * i + side
            groups.mate[e], groups.arc[e], groups.outer[i, side] = e, i, e
        groups.stamp[i] = i
        _copy(pieces.sums, i, groups.sums, i)
        _copy(pieces.fits, i, groups.fits, i)
        if circle.is_known(limits.bend.lens):
            # The image of a line replaces the free fit where the points are close enough to it.
            n = append(work, 2 * i, False, 0)
            if (circle.fit(trial.nodes, (0, n - 1), groups.sums[i, RSS], limits.bend, trial.fit, 0)
                    and trial.fit[0, circle.RSS]
                    <= limits.tolerance ** 2 * trial.fit[0, circle.COUNT]):
                _copy(trial.fit, 0, groups.fits, i)


@compiled
def _join(work: Workspace, limits: Limits) -> None:
    """Join pairs of ends, the cheapest first, until no pair is left."""
    groups, heap = work.groups, work.heap
    _begin(work, limits)
    heap.size[0] = 0
    if limits.max_gap == 0:
        return
    count = len(work.pieces.sums)
    for i in range(count):
        if groups.sums[i, SIZE] >= limits.min_seed:
            _queue(work, 2 * i, limits)
            _queue(work, 2 * i + 1, limits)
    stamp = count
    while heap.size[0] > 0:
        e, f, stamp_e, stamp_f = pop(heap)
        if groups.mate[e] != e or groups.stamp[groups.arc[e]] != stamp_e:
            continue
        if groups.mate[f] != f or groups.stamp[groups.arc[f]] != stamp_f:
            _queue(work, e, limits)
            continue
        a = _merge(work, e, f, stamp, limits)
        stamp += 1
        _queue(work, groups.outer[a, 0], limits)
        _queue(work, groups.outer[a, 1], limits)


@compiled
def _list(groups: Groups, order: np.ndarray, members: np.ndarray, offsets: np.ndarray,
          fits: np.ndarray) -> None:
    """Write the pieces of arcs in order, where each begins, and their fits."""
    n = 0
    offsets[0] = 0
    for i, a in enumerate(order):
        e = groups.outer[a, 0]
        while True:
            members[n, 0], members[n, 1] = e // 2, e % 2
            n += 1
            far = e + 1 - 2 * (e % 2)
            if groups.mate[far] == far:
                break
            e = groups.mate[far]
        offsets[i + 1] = n
        _copy(groups.fits, a, fits, i)


@compiled
def _is_arc(groups: Groups, min_seed: float, wanted: np.ndarray) -> None:
    """Mark the arcs that are long enough and have not become part of others."""
    for a in range(len(wanted)):
        e = groups.outer[a, 0]
        wanted[a] = (groups.mate[e] == e and groups.arc[e] == a
                     and groups.sums[a, SIZE] >= min_seed)


def join(pieces: Pieces, memory: Memory, frame: Frame, limits: Limits) -> Joined:
    """
    Join pieces to arcs; arcs of short pieces only are left out.

    Parameters
    ----------
    pieces, memory
        The pieces, and memory for as many.
    frame
        The image: no arc is joined across masked pixels.
    limits
        Limits of the frame.

    """
    m = len(pieces.sums)
    grid = sort_ends(pieces.ends, memory.order[:2 * m], memory.places[:2 * m], *frame.dx.shape)
    work = Workspace(pieces, grid, memory.groups, memory.trial, memory.heap, frame)
    _join(work, limits)
    wanted = np.empty(m, np.bool_)
    _is_arc(memory.groups, limits.min_seed, wanted)
    order = longest_first(memory.groups.sums[:m, SIZE], wanted)
    _list(memory.groups, order, memory.members, memory.offsets, memory.fits)
    return Joined(memory.members, memory.offsets[:len(order) + 1], memory.fits[:len(order)])
