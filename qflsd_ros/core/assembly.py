"""Step 6: the set of all arcs, each with its row in the table and its pixels."""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.arcs import Arcs, TABLE
from qflsd_ros.core.circle import compiled
from qflsd_ros.core.joining import foot, Joined, Pieces
from qflsd_ros.core.separation import separate
from qflsd_ros.core.validation import score, support

(START, MIDDLE, END, CURVATURE, LENGTH, RMS, COUNT, CURVATURE_STD, OFFSET_STD, SCORE, CONTRAST,
 POLARITY, COLUMNS) = 0, 2, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15


@compiled
def _describe(model: np.ndarray, start: np.ndarray, end: np.ndarray, row: np.ndarray) -> None:
    """Write the geometry of a fit between the feet of two points."""
    cx, cy = end[0] - start[0], end[1] - start[1]
    chord = math.sqrt(cx * cx + cy * cy)
    mx, my = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    gx = 2 * model[2] * (mx - model[0]) + model[3]
    gy = 2 * model[2] * (my - model[1]) + model[4]
    # The curve bends towards -A times its gradient; travel turns positively where that lies to
    # the side of the normal (-cy, cx).
    bend = 2 * abs(model[2])
    curvature = bend if model[2] * (gy * cx - gx * cy) < 0 else 0.0 - bend
    if bend == 0.0:
        curvature = 0.0
    half = math.asin(min(1.0, bend * chord / 2))
    sagitta = math.copysign(chord / 2 * math.tan(half / 2), curvature)
    row[START], row[START + 1] = start[0], start[1]
    row[MIDDLE], row[MIDDLE + 1] = mx + sagitta * cy / chord, my - sagitta * cx / chord
    row[END], row[END + 1] = end[0], end[1]
    row[CURVATURE], row[LENGTH] = curvature, 2 * half / bend if half > 1e-9 else chord
    row[RMS], row[COUNT] = math.sqrt(model[6] / model[7]), model[7]
    row[CURVATURE_STD], row[OFFSET_STD] = 2 * math.sqrt(model[8]), math.sqrt(model[9])


@compiled
def _turn(row: np.ndarray) -> None:
    """Let an arc be travelled from its other end."""
    for k in range(2):
        row[START + k], row[END + k] = row[END + k], row[START + k]
    row[CURVATURE], row[POLARITY] = 0.0 - row[CURVATURE], 0.0 - row[POLARITY]


@compiled
def describe(pieces: Pieces, joined: Joined, dx: np.ndarray, dy: np.ndarray, xs: np.ndarray,
             ys: np.ndarray, min_length: float, rows: np.ndarray, keep: np.ndarray) -> None:
    """
    Fill the rows of all arcs, and mark those to keep: long enough, and no accident.

    Travel is such that the brighter side lies to the right (where y points for travel along x).
    """
    start, end = np.empty(4), np.empty(4)
    for arc in range(len(joined.fits)):
        members, row = joined.members[joined.offsets[arc]:joined.offsets[arc + 1]], rows[arc]
        a, b = members[0], members[-1]
        first, last = pieces.ends[a[0], a[1]], pieces.ends[b[0], 1 - b[1]]
        foot(joined.fits[arc], first[0], first[1], start)
        foot(joined.fits[arc], last[0], last[1], end)
        _describe(joined.fits[arc], start, end, row)
        keep[arc] = row[LENGTH] >= min_length
        if not keep[arc]:
            continue
        aligned, contrast, towards = 0, 0.0, 0.0
        for piece, _ in members:
            first_point, last_point = pieces.runs[piece]
            counted, across, signs = support(joined.fits[arc], dx, dy, xs, ys,
                                             first_point, last_point)
            aligned, contrast, towards = aligned + counted, contrast + across, towards + signs
        row[SCORE] = score(row[COUNT], aligned, dx.size)
        row[CONTRAST], row[POLARITY] = contrast / row[COUNT], towards / row[COUNT]
        keep[arc] = row[SCORE] >= 0
        # P grows to the right of travel where its gradient is (-cy, cx), along the chord (cx, cy).
        cx, cy = end[0] - start[0], end[1] - start[1]
        if joined.fits[arc, 4] * cx - joined.fits[arc, 3] * cy < 0:
            row[POLARITY] = 0.0 - row[POLARITY]
        if row[POLARITY] < 0:
            _turn(row)
            members[:] = members[::-1].copy()
            members[:, 1] = 1 - members[:, 1]


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
def _gather(pieces: Pieces, joined: Joined, keep: np.ndarray, xs: np.ndarray, ys: np.ndarray,
            px: np.ndarray, py: np.ndarray, pixels: np.ndarray, points: np.ndarray,
            offsets: np.ndarray) -> int:
    """Copy pixels and points of the arcs to keep; return how many arcs they are."""
    arcs = n = 0
    for arc in range(len(keep)):
        if keep[arc]:
            for piece, backward in joined.members[joined.offsets[arc]:joined.offsets[arc + 1]]:
                n = _copy(pieces.runs[piece], backward, xs, ys, px, py, pixels, points, n)
            arcs += 1
            offsets[arcs] = n
    return arcs


def assemble(pieces: Pieces, joined: Joined, dx: np.ndarray, dy: np.ndarray, owners: np.ndarray,
             xs: np.ndarray, ys: np.ndarray, px: np.ndarray, py: np.ndarray, min_length: float,
             min_distance: float) -> Arcs:
    """Return the arcs that are long enough, no accident and not beside another one."""
    count, most = int(pieces.counts.sum()), len(joined.fits)
    rows, offsets, keep = np.empty((most, COLUMNS)), np.zeros(most + 1, np.int64), np.empty(most, bool)
    describe(pieces, joined, dx, dy, xs, ys, min_length, rows, keep)
    separate(rows, joined.fits, min_distance, owners, keep)
    pixels, points = np.empty((count, 2), np.int32), np.empty((count, 2))
    arcs = _gather(pieces, joined, keep, xs, ys, px, py, pixels, points, offsets)
    used = offsets[arcs]
    return Arcs(_table(rows[keep]), points[:used], pixels[:used], offsets[:arcs + 1])


def _table(rows: np.ndarray) -> np.ndarray:
    table, column = np.empty(len(rows), TABLE), 0
    for name in TABLE.names:
        size = 2 if TABLE[name].shape else 1
        table[name] = rows[:, column:column + size] if size > 1 else rows[:, column]
        column += size
    return table
