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
from qflsd_ros.core.tracking.state import END, MIDDLE, POLARITY, START

NEAR = 2.0          # px, from a track to an arc on it
PLACES = 8          # tracks on one arc that are looked at
LONGER = 3.0        # px, at least, by which an arc lengthens a track
ALIGNED = 1.2       # px, by which the shorter of an arc and a track may lie off the longer
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


@inlined
def _aligned(longer: np.ndarray, i: int, shorter: np.ndarray, j: int) -> bool:
    """Return whether start, middle and end of one arc lie on the curve of another."""
    arc = curve.curve(longer, i)
    for column in (START, MIDDLE, END):
        share, off = curve.place(arc, shorter[j, column], shorter[j, column + 1])
        if abs(off) > ALIGNED or abs(share * arc[4] * arc[6]) > 1 - curve.STEEPEST:
            return False
    return True


@inlined
def _reach(arc: curve.Curve, rows: np.ndarray, i: int) -> tuple[float, float]:
    """Return from which share of the half chord of a curve to which an arc reaches."""
    a, _ = curve.place(arc, rows[i, START], rows[i, START + 1])
    b, _ = curve.place(arc, rows[i, END], rows[i, END + 1])
    return min(a, b), max(a, b)


@compiled
def _lengthen(rows: np.ndarray, track: int, arcs: np.ndarray, i: int, forwards: bool) -> bool:
    """Let a track reach as far as an arc that lies on it; return whether it could."""
    old, new = curve.curve(rows, track), curve.curve(arcs, i)
    by_new = new[4] > old[4]
    if by_new:
        if not _aligned(arcs, i, rows, track):
            return False
        base, (first, last) = new, _reach(new, rows, track)
    else:
        if not _aligned(rows, track, arcs, i):
            return False
        base, (first, last) = old, _reach(old, arcs, i)
    if max(-1 - first, last - 1) * base[4] < LONGER and not by_new:
        return True
    first, last = min(first, -1.0), max(last, 1.0)
    if max(-first, last) * abs(base[6]) * base[4] > 1 - curve.STEEPEST:
        return False
    if by_new and not forwards:
        first, last = last, first
    for column, share in ((START, first), (MIDDLE, (first + last) / 2), (END, last)):
        rows[track, column], rows[track, column + 1], _, _ = curve.at(base, share)
    return True


@compiled
def associate(chart: np.ndarray, rows: np.ndarray, arcs: np.ndarray, order: np.ndarray,
              distance: float, covered: np.ndarray, absorbed: np.ndarray, fate: np.ndarray,
              names: np.ndarray, sums: np.ndarray) -> None:
    """
    Compare arcs with the tracks, and lengthen those on which they lie.

    Parameters
    ----------
    chart
        (H, W) int16, with the confirmed tracks.
    rows
        (M, COLUMNS) float64, the tracks.
    arcs
        (N, COLUMNS) float64, the detected arcs, of which the geometry counts.
    order
        (N,) int64, in which order to look at them.
    distance
        Up to which an arc beside a track is left out, px.
    covered
        (M,) float64, takes the length of each track that arcs lie on, px.
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
            if not absorbed[names[k]] and (best < 0 or sums[k] > sums[best]):
                best = k
        if best < 0:
            continue
        track = names[best]
        own = curve.curve(rows, track)
        if sums[best] < AT_LEAST * min(size, curve.length(own)):
            continue
        forwards = own[2] * arc[2] + own[3] * arc[3] > 0
        if not _lengthen(rows, track, arcs, i, forwards):
            continue
        fate[i] = KNOWN
        enter(chart, rows, track)
        for k in range(count):
            if k != best and sums[k] >= HIDDEN * curve.length(curve.curve(rows, names[k])):
                absorbed[names[k]] = True
