"""
Association of the arcs detected in a frame with the tracks.

An arc on a track lengthens it; an arc on no track begins a new one.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.suppression import HIDDEN
from qflsd_ros.core.tracking import curve
from qflsd_ros.core.tracking.chart import Chart, enter, EVERY, NOBODY, owner
from qflsd_ros.core.tracking.motion.looks import ONE_SIDED
from qflsd_ros.core.tracking.state import POLARITY, SCORE
from qflsd_ros.core.tracking.union import APART, CHANGED, lengthen

# Origin of these: chosen on photographs seen by a turning camera; they were not varied one by one.
NEAR = 2.0          # px from a track to an arc on it, at most
PLACES = 8          # tracks that are compared with one arc, at most
AT_LEAST = 0.3      # length that an arc and its track share, of the shorter one

# Class of an arc: it begins a track, lies on one, or is dropped as a parallel of one.
NEW, KNOWN, LEFT_OUT = 0, 1, 2


class Tally(NamedTuple):
    """The tracks that one arc lies on, and the length that it shares with each."""

    tracks: np.ndarray      # (PLACES,) int64
    lengths: np.ndarray     # (PLACES,) float64, px


class Outcome(NamedTuple):
    """The result of an association of N arcs with M tracks."""

    covered: np.ndarray     # (M,) float64, length of each track that arcs cover, px
    scores: np.ndarray      # (M,) float64, scores of these arcs, each times its share on the track
    absorbed: np.ndarray    # (M,) bool, whether a track became part of another
    fate: np.ndarray        # (N,) int64: class of each arc, NEW, KNOWN or LEFT_OUT


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
def _compare(chart: Chart, rows: np.ndarray, arc: curve.Curve, polarity: float,
             distance: float, tally: Tally) -> tuple[int, float]:
    """Fill the tally of an arc; return the number of its tracks, and its length on any, px."""
    size = curve.length(arc)
    steps = max(int(math.ceil(size / EVERY)), 1)
    length, count, beside = size / (steps + 1), 0, 0.0
    for j in range(steps + 1):
        x, y, nx, ny = curve.at(arc, 2 * j / steps - 1)
        track, cosine = owner(chart, x, y, nx, ny, max(NEAR, distance))
        if track == NOBODY:
            continue
        beside += length
        if cosine > 0 or min(rows[track, POLARITY], polarity) <= ONE_SIDED:
            count = _add(tally, count, track, length)
    return count, beside


@inlined
def _credit(tally: Tally, count: int, score: float, outcome: Outcome) -> int:
    """Credit an arc's score per px to its tracks; return the index of the longest part, or -1."""
    best = -1
    for k in range(count):
        track = tally.tracks[k]
        outcome.covered[track] += tally.lengths[k]
        outcome.scores[track] += score * tally.lengths[k]
        if not outcome.absorbed[track] and (best < 0 or tally.lengths[k] > tally.lengths[best]):
            best = k
    return best


@inlined
def _lengthen(chart: Chart, rows: np.ndarray, track: int, arcs: np.ndarray, i: int,
              shared: float) -> bool:
    """Lengthen a track by an arc that shares enough of its length; return whether it could."""
    own, arc = curve.curve(rows, track), curve.curve(arcs, i)
    if shared < AT_LEAST * min(curve.length(arc), curve.length(own)):
        return False
    forwards = own[2] * arc[2] + own[3] * arc[3] > 0
    union = lengthen(rows, track, arcs, i, forwards)
    if union == CHANGED:
        enter(chart, rows, track)
    return union != APART


@compiled
def associate(chart: Chart, rows: np.ndarray, arcs: np.ndarray, distance: float,
              tally: Tally, outcome: Outcome) -> None:
    """
    Compare arcs with the tracks, and lengthen those on which they lie.

    Parameters
    ----------
    chart
        With the confirmed tracks.
    rows
        (M, COLUMNS) float64, the tracks.
    arcs
        (N, COLUMNS) float64, the detected arcs, of which geometry, polarity and score count; they
        are compared in this order.
    distance
        Largest distance of an arc from a track, px: an arc that lies within it of tracks, for the
        share HIDDEN of its length, begins no track.
    tally
        Scratch.
    outcome
        Receives the result; its arrays are 0 and False before the call.

    """
    for i in range(len(arcs)):
        arc = curve.curve(arcs, i)
        size = curve.length(arc)
        count, beside = _compare(chart, rows, arc, arcs[i, POLARITY], distance, tally)
        outcome.fate[i] = NEW if beside < HIDDEN * size else LEFT_OUT
        best = _credit(tally, count, arcs[i, SCORE] / size, outcome)
        if best < 0 or not _lengthen(chart, rows, tally.tracks[best], arcs, i,
                                     tally.lengths[best]):
            continue
        outcome.fate[i] = KNOWN
        for k in range(count):
            own = curve.length(curve.curve(rows, tally.tracks[k]))
            if k != best and tally.lengths[k] >= HIDDEN * own:
                outcome.absorbed[tally.tracks[k]] = True
