"""The union of a track and an arc on the same curve."""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.tracking import curve
from qflsd_ros.core.tracking.state import END, MIDDLE, START

LONGER = 3.0        # px, least growth of a track by an arc; chosen, not tuned
# px, largest distance of the shorter of arc and track from the curve of the longer; chosen, not
# tuned.
ALIGNED = 1.2
# Result of a union: none, as both are not on one curve; the same track; a track that has changed.
APART, SAME, CHANGED = 0, 1, 2


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
    """Return the extent of an arc along the chord of a curve, in half chords from its middle."""
    a, _ = curve.place(arc, rows[i, START], rows[i, START + 1])
    b, _ = curve.place(arc, rows[i, END], rows[i, END + 1])
    return min(a, b), max(a, b)


@compiled
def lengthen(rows: np.ndarray, track: int, arcs: np.ndarray, i: int, forwards: bool) -> int:
    """
    Extend a track to the ends of an arc on the same curve.

    The curve is that of the longer one.  The arc is row i of ``arcs``; ``forwards`` is False if it
    travels against the track.

    Returns
    -------
    CHANGED; SAME if the arc does not extend the track by LONGER; APART if both are not on one
    curve, or their union turns by half a turn.

    """
    old, new = curve.curve(rows, track), curve.curve(arcs, i)
    by_new = new[4] > old[4]
    if by_new:
        if not _aligned(arcs, i, rows, track):
            return APART
        base, (first, last) = new, _reach(new, rows, track)
    else:
        if not _aligned(rows, track, arcs, i):
            return APART
        base, (first, last) = old, _reach(old, arcs, i)
    if max(-1 - first, last - 1) * base[4] < LONGER and not by_new:
        return SAME
    first, last = min(first, -1.0), max(last, 1.0)
    if max(-first, last) * abs(base[6]) * base[4] > 1 - curve.STEEPEST:
        return APART
    if by_new and not forwards:
        first, last = last, first
    for column, share in ((START, first), (MIDDLE, (first + last) / 2), (END, last)):
        rows[track, column], rows[track, column + 1], _, _ = curve.at(base, share)
    return CHANGED
