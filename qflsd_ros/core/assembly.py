"""Step 6: the set of all arcs, each with its row in the table and its pixels."""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.arcs import Arcs, TABLE
from qflsd_ros.core.circle import compiled
from qflsd_ros.core.joining import foot, Joined, Pieces

COLUMNS = 10        # start, middle, end (x, y each), curvature, length, rms, support


@compiled
def _describe(model: np.ndarray, start: np.ndarray, end: np.ndarray, row: np.ndarray) -> None:
    """Write start, middle, end, curvature, length, rms and support of a fit between two feet."""
    cx, cy = end[0] - start[0], end[1] - start[1]
    chord = math.sqrt(cx * cx + cy * cy)
    mx, my = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    gx = 2 * model[2] * (mx - model[0]) + model[3]
    gy = 2 * model[2] * (my - model[1]) + model[4]
    # The curve bends towards -A times its gradient; travel turns positively where that lies to
    # the side of the normal (-cy, cx).
    curvature = -2 * model[2] if gy * cx - gx * cy > 0 else 2 * model[2]
    half = math.asin(min(1.0, abs(curvature) * chord / 2))
    length = 2 * half / abs(curvature) if half > 1e-9 else chord
    sagitta = math.copysign(chord / 2 * math.tan(half / 2), curvature)
    row[0], row[1] = start[0], start[1]
    row[2], row[3] = mx + sagitta * cy / chord, my - sagitta * cx / chord
    row[4], row[5] = end[0], end[1]
    row[6], row[7] = curvature, length
    row[8], row[9] = math.sqrt(model[6] / model[7]), model[7]


@compiled
def _copy(run: np.ndarray, backward: int, xs: np.ndarray, ys: np.ndarray, px: np.ndarray,
          py: np.ndarray, pixels: np.ndarray, points: np.ndarray, n: int) -> int:
    """Copy the edge points of one piece, in order of travel, to rows n on; return the new n."""
    first, last, step = run[0], run[1], 1
    if backward:
        first, last, step = last, first, -1
    for i in range(first, last + step, step):
        pixels[n, 0], pixels[n, 1] = xs[i], ys[i]
        points[n, 0], points[n, 1] = px[i], py[i]
        n += 1
    return n


@compiled
def _gather(pieces: Pieces, joined: Joined, xs: np.ndarray, ys: np.ndarray, px: np.ndarray,
            py: np.ndarray, min_length: float, rows: np.ndarray, pixels: np.ndarray,
            points: np.ndarray, offsets: np.ndarray) -> int:
    """Fill rows, pixels and points of all arcs of at least ``min_length`` px; return how many."""
    arcs = n = 0
    start, end = np.empty(4), np.empty(4)
    for arc in range(len(joined.fits)):
        members = joined.members[joined.offsets[arc]:joined.offsets[arc + 1]]
        a, b = members[0], members[-1]
        first, last = pieces.ends[a[0], a[1]], pieces.ends[b[0], 1 - b[1]]
        foot(joined.fits[arc], first[0], first[1], start)
        foot(joined.fits[arc], last[0], last[1], end)
        _describe(joined.fits[arc], start, end, rows[arcs])
        if rows[arcs, 7] < min_length:
            continue
        for piece, backward in members:
            n = _copy(pieces.runs[piece], backward, xs, ys, px, py, pixels, points, n)
        arcs += 1
        offsets[arcs] = n
    return arcs


def assemble(pieces: Pieces, joined: Joined, xs: np.ndarray, ys: np.ndarray, px: np.ndarray,
             py: np.ndarray, min_length: float) -> Arcs:
    """Return the arcs of at least ``min_length`` px with their table and pixels."""
    support, most = int(pieces.counts.sum()), len(joined.fits)
    rows, offsets = np.empty((most, COLUMNS)), np.zeros(most + 1, np.int64)
    pixels, points = np.empty((support, 2), np.int32), np.empty((support, 2))
    count = _gather(pieces, joined, xs, ys, px, py, min_length, rows, pixels, points, offsets)
    table = np.empty(count, TABLE)
    rows = rows[:count]
    table['start'], table['middle'], table['end'] = rows[:, 0:2], rows[:, 2:4], rows[:, 4:6]
    table['curvature'], table['length'] = rows[:, 6], rows[:, 7]
    table['rms'], table['support'] = rows[:, 8], rows[:, 9]
    used = offsets[count]
    return Arcs(table, points[:used], pixels[:used], offsets[:count + 1])
