"""
Measurement: the position of a track from the edges along its normals, near its predicted place.

The distances e of edges along the normals, at the position s along the chord (-1 to 1), are fitted
by e = o + t s + b (s^2 - 1 / 3): offset, turn and bend, by least squares with Tukey's weights.
The predicted place counts as additional edges (ridge regression), so that a track that is seen in
part does not rotate about that part.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.tracking import curve
from qflsd_ros.core.tracking.confirmation import needed
from qflsd_ros.core.tracking.motion.looks import nearest, ONE_SIDED, weakest
from qflsd_ros.core.tracking.normals import EDGES, edges_along, in_sight, Sight
from qflsd_ros.core.tracking.state import (
    CONTRAST, EDGES as EDGE_COUNT, END, FIRST, LAST, LOST, MIDDLE, POLARITY, RMS, SHIFT, START,
    STEP, SUPPORT, TURN)

# All of these are chosen, not tuned.
SPACING = 3.0           # px between normals
WIDER = 6.0             # px between normals in images that are not searched for arcs
LEAST, MOST = 6, 40     # fewest and most normals of a track
REACH = 3.5             # px, length of a normal on either side
GATES = (3.5, 2.5, 1.8, 1.5)    # px from which on an edge has no weight, by iteration
CLOSE = 1.0             # px, largest distance of an edge that supports a track
BENDS = 8               # normals in sight from which on a bend is fitted
# Weights of the predicted offset, turn and bend, in edges.
STIFF = 0.05, 0.5, 4.0
SHRINK = 0.25           # share of an unsupported end by which a track is shortened in each frame
LEAST_SEEN = 5          # normals in sight, below which a track is not measured
MEMORY = 0.8            # weight of the past in the running mean of the contrast
OWN = 0.5               # gain of a track's own motion, relative to the field, for its residual

# Offset, turn and bend, px.
Fit = tuple[float, float, float]


class Effort(NamedTuple):
    """Which tracks are measured, and how densely."""

    patience: int           # frames lost, at most, of a track that is measured
    spacing: float          # px between normals


class Normals(NamedTuple):
    """Memory for the normals of one track."""

    shares: np.ndarray      # (MOST,) float64, position of each along the chord, -1 to 1
    rays: np.ndarray        # (MOST, 4) float64, the point on the track there, px, and the normal
    found: np.ndarray       # (MOST, EDGES) float64, distances of edges along it, px
    counts: np.ndarray      # (MOST,) int64, number of these edges
    strength: np.ndarray    # (MOST, EDGES) float64, their gradients, grey levels


def memory() -> Normals:
    """Return memory for the normals of one track."""
    return Normals(np.empty(MOST), np.empty((MOST, 4)), np.empty((MOST, EDGES)),
                   np.empty(MOST, np.int64), np.empty((MOST, EDGES)))


@inlined
def _value(fit: Fit, s: float) -> float:
    """Return the fitted distance from the predicted place at the position s, px."""
    return fit[0] + fit[1] * s + fit[2] * (s * s - 1 / 3)


@inlined
def _fit(normals: Normals, n: int, fit: Fit, gate: float, terms: int) -> Fit:
    """Return the fit, with 1 to 3 ``terms``, to the edges nearest to the previous ``fit``."""
    a00, a11, a22 = STIFF
    a01 = a02 = a12 = b0 = b1 = b2 = 0.0
    scale = 1 / gate
    for k in range(n):
        s = normals.shares[k]
        q = s * s - 1 / 3
        expected = fit[0] + fit[1] * s + fit[2] * q
        e = nearest(normals.found[k], normals.counts[k], expected)
        r = (e - expected) * scale
        if not abs(r) < 1:
            continue
        w = (1 - r * r) * (1 - r * r)
        a00 += w
        a01 += w * s
        a02 += w * q
        a11 += w * s * s
        a12 += w * s * q
        a22 += w * q * q
        b0 += w * e
        b1 += w * s * e
        b2 += w * q * e
    if terms == 1:
        return b0 / a00, 0.0, 0.0
    if terms == 2:
        det = a00 * a11 - a01 * a01
        return (b0 * a11 - b1 * a01) / det, (a00 * b1 - a01 * b0) / det, 0.0
    c00, c01, c02 = a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11
    c11, c12, c22 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
    det = a00 * c00 + a01 * c01 + a02 * c02
    return ((c00 * b0 + c01 * b1 + c02 * b2) / det, (c01 * b0 + c11 * b1 + c12 * b2) / det,
            (c02 * b0 + c12 * b1 + c22 * b2) / det)


@inlined
def _move(rows: np.ndarray, i: int, fit: Fit) -> None:
    """Move start, middle and end of a track along their normals."""
    arc = curve.curve(rows, i)
    for column, s in ((START, -1.0), (MIDDLE, 0.0), (END, 1.0)):
        x, y, nx, ny = curve.at(arc, s)
        off = _value(fit, s)
        rows[i, column], rows[i, column + 1] = x + off * nx, y + off * ny


@inlined
def _shorten(rows: np.ndarray, i: int, first: float, last: float) -> None:
    """Move the ends of a track towards its outermost supported normals among those in sight."""
    start = -1 + SHRINK * max(rows[i, FIRST] - first, 0.0)
    end = 1 - SHRINK * max(last - rows[i, LAST], 0.0)
    if start == -1 and end == 1:
        return
    arc = curve.curve(rows, i)
    for column, share in ((START, start), (MIDDLE, (start + end) / 2), (END, end)):
        rows[i, column], rows[i, column + 1], _, _ = curve.at(arc, share)


@inlined
def _index_of_nearest(distances: np.ndarray, count: int, expected: float) -> int:
    """Return the index of the edge nearest to an expected one within CLOSE px, or -1."""
    best, least = -1, CLOSE
    for e in range(count):
        if abs(distances[e] - expected) < least:
            best, least = e, abs(distances[e] - expected)
    return best


@inlined
def _write(row: np.ndarray, normals: Normals, n: int, fit: Fit, half: float,
           points: np.ndarray) -> None:
    """
    Write the support of a fit: its share, extent, rms, contrast and edge points.

    ``half`` is half the distance between two normals along the chord.
    """
    inliers, squares, steps = 0, 0.0, 0.0
    row[FIRST], row[LAST] = 1.0, -1.0
    for k in range(n):
        share = normals.shares[k]
        expected = _value(fit, share)
        best = _index_of_nearest(normals.found[k], normals.counts[k], expected)
        if best < 0:
            continue
        off = normals.found[k, best]
        ray = normals.rays[k]
        points[inliers, 0], points[inliers, 1] = ray[0] + off * ray[2], ray[1] + off * ray[3]
        inliers += 1
        squares += (off - expected) ** 2
        steps += normals.strength[k, best]
        row[FIRST] = min(row[FIRST], share - half)
        row[LAST] = max(row[LAST], share + half)
    row[SUPPORT], row[EDGE_COUNT] = inliers / max(n, 1), inliers
    if inliers > 0:
        row[RMS], row[STEP] = math.sqrt(squares / inliers), steps / inliers


@inlined
def _count(arc: curve.Curve, spacing: float) -> int:
    """Return the number of normals of an arc."""
    return min(max(int(2 * arc[4] / spacing), LEAST), MOST)


@inlined
def _look(image: Sight, rows: np.ndarray, i: int, needed: float, count: int,
          normals: Normals) -> int:
    """
    Find the edges along ``count`` normals of a track; return the number of normals in sight.

    It is 0 if so many normals have no edge that the track cannot have the support ``needed``.
    """
    arc = curve.curve(rows, i)
    wanted = weakest(rows, i, image.noise), rows[i, POLARITY] > ONE_SIDED
    n, empty, most = 0, 0, (1 - needed) * count
    for j in range(count):
        s = (2 * j + 1) / count - 1
        x, y, nx, ny = curve.at(arc, s)
        if not in_sight(image, x, y):
            continue
        normals.shares[n] = s
        normals.rays[n] = x, y, nx, ny
        normals.counts[n] = edges_along(image, (x, y, nx, ny), REACH, wanted, normals.found[n],
                                        normals.strength[n])
        empty += normals.counts[n] == 0
        if empty > most:
            return 0
        n += 1
    return n


@inlined
def _follow(rows: np.ndarray, i: int, fit: Fit, normals: Normals, n: int) -> None:
    """Move a track to where it was found, and learn from that its contrast and own motion."""
    _move(rows, i, fit)
    _shorten(rows, i, normals.shares[0], normals.shares[n - 1])
    rows[i, CONTRAST] += (1 - MEMORY) * (rows[i, STEP] - rows[i, CONTRAST])
    rows[i, SHIFT] += OWN * fit[0]
    rows[i, TURN] += OWN * fit[1]


@compiled
def measure(image: Sight, rows: np.ndarray, effort: Effort, normals: Normals, points: np.ndarray,
            confirmed: np.ndarray) -> None:
    """
    Measure tracks near their predicted places.

    Parameters
    ----------
    image
        The frame.
    rows
        (M, COLUMNS) float64, the tracks; those that are confirmed are moved.
    effort
        Which tracks are measured; others are not confirmed.
    normals
        Scratch.
    points
        (M or more, MOST, 2) float64, receives the edges that support each track, px, in order
        along it.
    confirmed
        (M or more,) bool, receives which tracks have the support that they need.

    """
    for i in range(len(rows)):
        confirmed[i] = False
        if rows[i, LOST] <= effort.patience:
            least, count = needed(rows, i), _count(curve.curve(rows, i), effort.spacing)
            n = _look(image, rows, i, least, count, normals)
            if n >= LEAST_SEEN:
                fit = 0.0, 0.0, 0.0
                for step, gate in enumerate(GATES):
                    fit = _fit(normals, n, fit, gate, min(step + 1, 3 if n >= BENDS else 2))
                _write(rows[i], normals, n, fit, 1 / count, points[i])
                if rows[i, SUPPORT] >= least:
                    _follow(rows, i, fit, normals, n)
                    confirmed[i] = True
        if not confirmed[i]:
            rows[i, SHIFT] *= OWN
            rows[i, TURN] *= OWN
