"""
What the arcs detected in a frame say of the tracks: on which they lie, and where they lead on.

A detected arc on a track lengthens it; one on no track becomes a new one.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.tracking import curve
from qflsd_ros.core.tracking.chart import enter, EVERY, HIDDEN, NOBODY, owner
from qflsd_ros.core.tracking.looks import ONE_SIDED
from qflsd_ros.core.tracking.state import POLARITY, SCORE
from qflsd_ros.core.tracking.union import lengthen

NEAR = 2.0          # px, from a track to an arc on it
PLACES = 8          # tracks on one arc that are looked at
AT_LEAST = 0.3      # of the shorter of them: that they have in common

NEW, KNOWN, LEFT_OUT = 0, 1, 2      # what becomes of an arc


@inlined
def _add(names: np.ndarray, sums: np.ndarray, count: int, track: int, weight: float) -> int:
    """Add to the length that an arc has on a track; return how many tracks there are."""
    for k in range(count):
        if names[k] == track:
            sums[k] += weight
            return count
    if count < PLACES:
        names[count], sums[count] = track, weight
        count += 1
    return count


@compiled
def associate(chart: np.ndarray, rows: np.ndarray, arcs: np.ndarray, order: np.ndarray,
              distance: float, covered: np.ndarray, scores: np.ndarray, absorbed: np.ndarray,
              fate: np.ndarray, names: np.ndarray, sums: np.ndarray) -> None:
    """
    Compare arcs with the tracks, and lengthen those on which they lie.

    Parameters
    ----------
    chart
        (H, W) int16, with the confirmed tracks.
    rows
        (M, COLUMNS) float64, the tracks.
    arcs
        (N, COLUMNS) float64, the detected arcs, of which geometry, polarity and score count.
    order
        (N,) int64, in which order to look at them.
    distance
        Up to which an arc beside a track is left out, px.
    covered, scores
        (M,) float64, to which the lengths of the arcs on each track are added, px, and their
        scores, in proportion.
    absorbed
        (M,) bool, set True for tracks that became a part of another.
    fate
        (N,) int64, takes what becomes of each arc: NEW, KNOWN or LEFT_OUT.
    names, sums
        (PLACES,) int64 and float64, scratch.

    """
    for i in order:
        arc = curve.curve(arcs, i)
        size = curve.length(arc)
        steps = max(int(math.ceil(size / EVERY)), 1)
        weight, count, beside, same = size / (steps + 1), 0, 0.0, 0.0
        for j in range(steps + 1):
            x, y, nx, ny = curve.at(arc, 2 * j / steps - 1)
            track, cosine = owner(chart, rows, x, y, nx, ny, max(NEAR, distance))
            if track == NOBODY:
                continue
            beside += weight
            if cosine > 0 or min(rows[track, POLARITY], arcs[i, POLARITY]) <= ONE_SIDED:
                same += weight
                count = _add(names, sums, count, track, weight)
        fate[i] = NEW if beside < HIDDEN * size else LEFT_OUT
        best = -1
        for k in range(count):
            covered[names[k]] += sums[k]
            scores[names[k]] += arcs[i, SCORE] * sums[k] / size
            if not absorbed[names[k]] and (best < 0 or sums[k] > sums[best]):
                best = k
        if best < 0:
            continue
        track = names[best]
        own = curve.curve(rows, track)
        if sums[best] < AT_LEAST * min(size, curve.length(own)):
            continue
        forwards = own[2] * arc[2] + own[3] * arc[3] > 0
        if not lengthen(rows, track, arcs, i, forwards):
            continue
        fate[i] = KNOWN
        enter(chart, rows, track)
        for k in range(count):
            if k != best and sums[k] >= HIDDEN * curve.length(curve.curve(rows, names[k])):
                absorbed[names[k]] = True
