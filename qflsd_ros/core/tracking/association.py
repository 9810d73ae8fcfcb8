"""
Association of the arcs detected in a frame with the tracks.

Tracks that lie on longer ones are hidden or merged into them.  An arc on a track lengthens it; an
arc on no track begins a new one.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from qflsd_ros.core.arcs import POLARITY as ARC_POLARITY, SCORE as ARC_SCORE
from qflsd_ros.core.compilation import inlined
from qflsd_ros.core.detection.suppression import HIDDEN
from qflsd_ros.core.tracking import curve
from qflsd_ros.core.tracking.motion.looks import ONE_SIDED
from qflsd_ros.core.tracking.neighbours import compare, enter, Grid, NOBODY
from qflsd_ros.core.tracking.state import MOST, POLARITY
from qflsd_ros.core.tracking.union import APART, CHANGED, lengthen

# Origin of these: chosen on photographs seen by a turning camera; they were not varied one by one.
NEAR = 2.0          # px from a track to an arc on it, at most
CLOSER = 0.7        # largest distance of a hidden track, as a share of min_distance
PLACES = 8          # tracks that are compared with one arc, at most
AT_LEAST = 0.3      # length that an arc and its track share, of the shorter one
SHARED = 3          # successive points on one other track from which on both are merged

# Class of an arc: it begins a track, lies on one, or is dropped as a parallel of one.
NEW, KNOWN, LEFT_OUT = 0, 1, 2


class Tally(NamedTuple):
    """The tracks that one arc lies on, and the length that it shares with each."""

    tracks: np.ndarray      # (PLACES,) int64
    lengths: np.ndarray     # (PLACES,) float64, px


class Detected(NamedTuple):
    """The N arcs detected in a frame."""

    arcs: np.ndarray        # (N, arcs.COLUMNS) float64
    lengths: np.ndarray     # (N,) float64, px
    order: np.ndarray       # (N,) int64, receives the order of comparison
    fates: np.ndarray       # (N,) int64, class of each arc, NEW, KNOWN or LEFT_OUT


class Outcome(NamedTuple):
    """The result of an association with M tracks, and scratch; the first M of each are used."""

    covered: np.ndarray     # (MOST,) float64, length of each track that arcs cover, px
    scores: np.ndarray      # (MOST,) float64, their scores, each times its share on the track
    absorbed: np.ndarray    # (MOST,) bool, whether a track became part of another
    hidden: np.ndarray      # (MOST,) bool, whether a track lies on others, or is absorbed
    ranks: np.ndarray       # (MOST,) float64: tracks are entered in this order, the largest first
    order: np.ndarray       # (MOST,) int64, the tracks in this order
    tally: Tally


def memory() -> Outcome:
    """Return memory for the result of an association."""
    return Outcome(np.empty(MOST), np.empty(MOST), np.empty(MOST, np.bool_),
                   np.empty(MOST, np.bool_), np.empty(MOST), np.empty(MOST, np.int64),
                   Tally(np.empty(PLACES, np.int64), np.empty(PLACES)))


@inlined
def sort(ranks: np.ndarray, order: np.ndarray, count: int) -> None:
    """
    Sort the first ``count`` of ``order`` by their ranks, the largest first (Shell, 1959).

    Of equal ranks the smaller number comes first.
    """
    gap = count // 2
    while gap > 0:
        for i in range(gap, count):
            item, j = order[i], i
            while j >= gap:
                other = order[j - gap]
                if ranks[other] > ranks[item] or (ranks[other] == ranks[item] and other < item):
                    break
                order[j] = other
                j -= gap
            order[j] = item
        gap //= 2


@inlined
def _is_hidden(grid: Grid, count: int) -> tuple[bool, int]:
    """Return whether the points compared lie on tracks, and the last track that shares a run."""
    on_others, last, run, partner = 0, NOBODY, 0, NOBODY
    for j in range(count):
        track = grid.owners[j]
        if track == NOBODY:
            continue
        on_others += 1
        if grid.cosines[j] > 0:
            run = run + 1 if track == last else 1
            last = track
            if run >= SHARED:
                partner = track
    return on_others >= HIDDEN * count, partner


@inlined
def enter_all(grid: Grid, rows: np.ndarray, confirmed: np.ndarray, distance: float,
              outcome: Outcome) -> None:
    """
    Enter confirmed tracks by rank, except for those hidden by tracks that were entered before.

    A track is hidden if the share HIDDEN of its points lies on others.  One that overlaps a track
    less than that, on the same curve, is merged into it.

    Parameters
    ----------
    grid
        Without tracks before the call.
    rows
        (M, COLUMNS) float64, the tracks.
    confirmed
        (M or more,) bool, which are confirmed.
    distance
        The parameter ``min_distance``, px.
    outcome
        Has the ranks; receives in ``hidden`` which tracks are not entered, and in ``absorbed``
        which of these are merged.

    """
    reach, count = max(NEAR, distance), 0
    for i in range(len(rows)):
        outcome.hidden[i] = outcome.absorbed[i] = False
        if confirmed[i]:
            outcome.order[count] = i
            count += 1
    sort(outcome.ranks, outcome.order, count)
    for k in range(count):
        i = outcome.order[k]
        hidden, partner = _is_hidden(grid, compare(grid, curve.curve(rows, i), CLOSER * distance))
        if not hidden and partner != NOBODY and lengthen(rows, partner, rows, i, True) != APART:
            hidden = outcome.absorbed[i] = True
            enter(grid, rows, partner, reach)
        outcome.hidden[i] = hidden
        if not hidden:
            enter(grid, rows, i, reach)


@inlined
def _add(tally: Tally, count: int, track: int, length: float) -> int:
    """Add px to the length that an arc shares with a track; return the new ``count`` of tracks."""
    for k in range(count):
        if tally.tracks[k] == track:
            tally.lengths[k] += length
            return count
    if count < PLACES:
        tally.tracks[count], tally.lengths[count] = track, length
        count += 1
    return count


@inlined
def _tally(grid: Grid, rows: np.ndarray, points: int, length: float, polarity: float,
           tally: Tally) -> tuple[int, float]:
    """Fill the tally of an arc; return the number of its tracks, and its length on any, px."""
    count, beside = 0, 0.0
    for j in range(points):
        track = grid.owners[j]
        if track == NOBODY:
            continue
        beside += length
        if grid.cosines[j] > 0 or min(rows[track, POLARITY], polarity) <= ONE_SIDED:
            count = _add(tally, count, track, length)
    return count, beside


@inlined
def _credit(count: int, score: float, outcome: Outcome) -> int:
    """Credit an arc's score per px to its tracks; return the index of the longest part, or -1."""
    best, tally = -1, outcome.tally
    for k in range(count):
        track = tally.tracks[k]
        outcome.covered[track] += tally.lengths[k]
        outcome.scores[track] += score * tally.lengths[k]
        if not outcome.absorbed[track] and (best < 0 or tally.lengths[k] > tally.lengths[best]):
            best = k
    return best


@inlined
def _lengthen(rows: np.ndarray, track: int, arcs: np.ndarray, i: int, shared: float) -> int:
    """Lengthen a track by an arc that shares enough of its length; return what became of it."""
    own, arc = curve.curve(rows, track), curve.curve(arcs, i)
    if shared < AT_LEAST * min(curve.length(arc), curve.length(own)):
        return APART
    return lengthen(rows, track, arcs, i, own[2] * arc[2] + own[3] * arc[3] > 0)


@inlined
def _absorb(rows: np.ndarray, count: int, best: int, outcome: Outcome) -> None:
    """Mark the tracks, other than ``best``, that an arc covers: they are parts of that one."""
    for k in range(count):
        track = outcome.tally.tracks[k]
        own = curve.length(curve.curve(rows, track))
        if k != best and outcome.tally.lengths[k] >= HIDDEN * own:
            outcome.absorbed[track] = True


@inlined
def associate(grid: Grid, rows: np.ndarray, detected: Detected, distance: float,
              outcome: Outcome) -> None:
    """
    Compare arcs with the tracks, and lengthen those on which they lie.

    Parameters
    ----------
    grid
        With the confirmed tracks.
    rows
        (M, COLUMNS) float64, the tracks.
    detected
        The arcs, which are compared the longest first; receives their fates.
    distance
        The parameter ``min_distance``, px: an arc that lies within it of tracks, for the share
        HIDDEN of its length, begins no track.
    outcome
        Receives the rest of the result.

    """
    reach, arcs = max(NEAR, distance), detected.arcs
    for i in range(len(rows)):
        outcome.covered[i] = outcome.scores[i] = 0.0
    for i in range(len(arcs)):
        detected.order[i] = i
    sort(detected.lengths, detected.order, len(arcs))
    for k in range(len(arcs)):
        i = detected.order[k]
        arc = curve.curve(arcs, i)
        size, points = curve.length(arc), compare(grid, arc, reach)
        count, beside = _tally(grid, rows, points, size / points, arcs[i, ARC_POLARITY],
                               outcome.tally)
        detected.fates[i] = NEW if beside < HIDDEN * size else LEFT_OUT
        best = _credit(count, arcs[i, ARC_SCORE] / size, outcome)
        if best < 0:
            continue
        track = outcome.tally.tracks[best]
        union = _lengthen(rows, track, arcs, i, outcome.tally.lengths[best])
        if union == APART:
            continue
        if union == CHANGED:
            enter(grid, rows, track, reach)
        detected.fates[i] = KNOWN
        _absorb(rows, count, best, outcome)
