"""Step 6: the set of all arcs, each with its row in the table and its pixels."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.arcs import (
    BENT, COLUMNS, CONTRAST, CURVATURE, CURVATURE_STD, END, LENGTH, MIDDLE, OFFSET_STD, POLARITY,
    RMS, SCORE, START, SUPPORT)
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.extension import extended, FARTHEST
from qflsd_ros.core.detection.joining import Joined, MOST_TURN, Pieces
from qflsd_ros.core.detection.region import Region
from qflsd_ros.core.detection.suppression import separate
from qflsd_ros.core.detection.validation import (
    ALIGNED, closeness, Evidence, LOOKS, score, SIGNS, STEPS, STRONG, WEIGHT, witness, WITNESSES)

SAMPLED = 0.5           # px at most between the points of an arc that are compared with a mask


class Found(NamedTuple):
    """M arcs and the N edge points behind them."""

    rows: np.ndarray        # (M, COLUMNS) float64, deviations as for points of 1 px
    points: np.ndarray      # (2, N) float64, px
    pixels: np.ndarray      # (N, 2) int32, x and y
    offsets: np.ndarray     # (M + 1,) int64


@inlined
def write_geometry(fits: np.ndarray, fit: int, x0: float, y0: float, x1: float, y1: float,
                   rows: np.ndarray, arc: int) -> None:
    """Write where an arc is, which begins and ends at two points of a fitted curve."""
    cx, cy, mx, my = x1 - x0, y1 - y0, (x0 + x1) / 2, (y0 + y1) / 2
    chord = math.sqrt(cx * cx + cy * cy)
    gx = 2 * fits[fit, 2] * (mx - fits[fit, 0]) + fits[fit, 3]
    gy = 2 * fits[fit, 2] * (my - fits[fit, 1]) + fits[fit, 4]
    # The curve bends towards -A times its gradient; travel turns positively where that lies to
    # the side of the normal (-cy, cx).
    bend = 2 * abs(fits[fit, 2])
    turn = 1.0 if fits[fit, 2] * (gy * cx - gx * cy) < 0 else -1.0
    half = math.asin(min(1.0, bend * chord / 2))
    sagitta = turn * chord / 2 * math.tan(half / 2)
    rows[arc, START], rows[arc, START + 1] = x0, y0
    rows[arc, MIDDLE] = mx + sagitta * cy / chord
    rows[arc, MIDDLE + 1] = my - sagitta * cx / chord
    rows[arc, END], rows[arc, END + 1] = x1, y1
    rows[arc, CURVATURE] = turn * bend if bend > 0 else 0.0
    rows[arc, LENGTH] = 2 * half / bend if half > 1e-9 else chord


@inlined
def _is_open(allowed: np.ndarray, x: float, y: float) -> bool:
    """Return whether no masked pixel is within half a sampling step of a point, along x and y."""
    for side_x in (-SAMPLED / 2, SAMPLED / 2):
        column = min(max(int(math.floor(x + side_x + 0.5)), 0), allowed.shape[1] - 1)
        for side_y in (-SAMPLED / 2, SAMPLED / 2):
            row = min(max(int(math.floor(y + side_y + 0.5)), 0), allowed.shape[0] - 1)
            if not allowed[row, column]:
                return False
    return True


@compiled
def _avoids(rows: np.ndarray, arc: int, allowed: np.ndarray) -> bool:
    """Return whether no point of an arc is on a masked pixel: each is close to one looked at."""
    x0, y0 = rows[arc, START], rows[arc, START + 1]
    cx, cy = rows[arc, END] - x0, rows[arc, END + 1] - y0
    half = rows[arc, CURVATURE] * rows[arc, LENGTH] / 2
    steps = int(math.ceil(rows[arc, LENGTH] / SAMPLED))
    for i in range(steps + 1):
        # Up to there it turns by twice this part of its half turn: a chord, and half as much on.
        part = half * i / steps
        along = math.sin(part) / math.sin(half) if abs(half) > 1e-9 else i / steps
        c, s = along * math.cos(part - half), along * math.sin(part - half)
        if not _is_open(allowed, x0 + c * cx - s * cy, y0 + c * cy + s * cx):
            return False
    return True


@inlined
def is_inside(rows: np.ndarray, arc: int, where: Region) -> bool:
    """Return whether an arc lies in the image, within half a pixel, and on no masked pixel."""
    height, width = where.allowed.shape
    for place in (START, MIDDLE, END):
        x, y = rows[arc, place], rows[arc, place + 1]
        if not (-0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5):
            return False
    return not where.masked or _avoids(rows, arc, where.allowed)


@inlined
def _extend(fits: np.ndarray, arc: int, evidence: Evidence, rows: np.ndarray) -> None:
    """Let both ends of an arc go on as far as its edge does."""
    if (rows[arc, LENGTH] + 2 * FARTHEST) * abs(rows[arc, CURVATURE]) > MOST_TURN:
        return
    x0, y0 = rows[arc, START], rows[arc, START + 1]
    x1, y1 = rows[arc, END], rows[arc, END + 1]
    u0, v0 = extended(fits, arc, x0, y0, x1, y1, evidence)
    u1, v1 = extended(fits, arc, x1, y1, x0, y0, evidence)
    write_geometry(fits, arc, u0, v0, u1, v1, rows, arc)
    if not is_inside(rows, arc, evidence.region):
        write_geometry(fits, arc, x0, y0, x1, y1, rows, arc)


@inlined
def _agree(piece_fits: np.ndarray, piece: int, fits: np.ndarray, arc: int) -> bool:
    """Return whether P grows to the same side of a piece and of its arc."""
    x, y = piece_fits[piece, 0] - fits[arc, 0], piece_fits[piece, 1] - fits[arc, 1]
    nx, ny = 2 * fits[arc, 2] * x + fits[arc, 3], 2 * fits[arc, 2] * y + fits[arc, 4]
    return piece_fits[piece, 3] * nx + piece_fits[piece, 4] * ny > 0


@inlined
def _evidence(piece_fits: np.ndarray, found: np.ndarray, members: np.ndarray, begin: int, end: int,
              fits: np.ndarray, arc: int, noise: float, tolerance: float,
              rows: np.ndarray) -> None:
    """Write score, contrast, and as polarity the share of points where P grows, less the rest."""
    weight, aligned, steps, signs, looks, strong = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(begin, end):
        piece = members[k, 0]
        weight += found[piece, WEIGHT]
        aligned += found[piece, ALIGNED]
        steps += found[piece, STEPS]
        looks += found[piece, LOOKS]
        strong += found[piece, STRONG]
        agree = _agree(piece_fits, piece, fits, arc)
        signs += found[piece, SIGNS] if agree else -found[piece, SIGNS]
    rows[arc, CONTRAST] = steps / rows[arc, SUPPORT]
    rows[arc, POLARITY] = signs / rows[arc, SUPPORT]
    rows[arc, SCORE] = (score(weight, aligned, strong / max(looks, 1.0), len(rows))
                        + closeness(rows[arc, SUPPORT], rows[arc, RMS],
                                    noise / rows[arc, CONTRAST], tolerance))


@compiled
def _orient(fits: np.ndarray, arc: int, members: np.ndarray, begin: int, end: int,
            rows: np.ndarray) -> None:
    """Let travel be such that the brighter side lies to the right (along x: where y points)."""
    cx = rows[arc, END] - rows[arc, START]
    cy = rows[arc, END + 1] - rows[arc, START + 1]
    if fits[arc, 4] * cx < fits[arc, 3] * cy:
        rows[arc, POLARITY] = -rows[arc, POLARITY]
    if rows[arc, POLARITY] >= 0:
        return
    rows[arc, POLARITY], rows[arc, CURVATURE] = -rows[arc, POLARITY], 0.0 - rows[arc, CURVATURE]
    for k in range(2):
        rows[arc, START + k], rows[arc, END + k] = rows[arc, END + k], rows[arc, START + k]
    for k in range(begin, end):
        members[k, 1] = 1 - members[k, 1]
    for k in range((end - begin) // 2):
        for column in range(2):
            members[begin + k, column], members[end - 1 - k, column] = (
                members[end - 1 - k, column], members[begin + k, column])


@compiled
def _describe(ends: np.ndarray, evidence: Evidence, members: np.ndarray, begins: np.ndarray,
              fits: np.ndarray, min_length: float, rows: np.ndarray, keep: np.ndarray,
              extended: np.ndarray, wanted: np.ndarray) -> None:
    """
    Fill in what follows from the fits, and mark the arcs that are long enough, and their pieces.

    What is wide of its points, as a large tolerance allows, may lie outside the image, or on what
    is masked: it is none.
    """
    for arc in range(len(keep)):
        begin, end = begins[arc], begins[arc + 1]
        first = 2 * members[begin, 0] + members[begin, 1]
        last = 2 * members[end - 1, 0] + 1 - members[end - 1, 1]
        x0, y0, _, _ = circle.foot(fits, arc, ends[first, 0], ends[first, 1])
        x1, y1, _, _ = circle.foot(fits, arc, ends[last, 0], ends[last, 1])
        write_geometry(fits, arc, x0, y0, x1, y1, rows, arc)
        rows[arc, RMS] = math.sqrt(fits[arc, 6] / fits[arc, 7])
        # The fit's count is a sum of quadrature weights: whole up to rounding.
        rows[arc, SUPPORT] = np.rint(fits[arc, 7])
        rows[arc, CURVATURE_STD] = 2 * math.sqrt(fits[arc, 9])
        rows[arc, OFFSET_STD] = math.sqrt(fits[arc, 10])
        rows[arc, BENT] = fits[arc, 11]
        keep[arc] = is_inside(rows, arc, evidence.region)
        # What is long enough before it is extended may wait until it is known to be no accident.
        extended[arc] = keep[arc] and rows[arc, LENGTH] < min_length
        if extended[arc]:
            _extend(fits, arc, evidence, rows)
            keep[arc] = rows[arc, LENGTH] >= min_length
        for k in range(begin, end):
            wanted[members[k, 0]] = keep[arc]


@compiled
def _judge(piece_fits: np.ndarray, evidence: Evidence, found: np.ndarray, members: np.ndarray,
           begins: np.ndarray, fits: np.ndarray, tolerance: float, min_score: float,
           extended: np.ndarray, rows: np.ndarray, keep: np.ndarray) -> None:
    """Fill in what speaks for the arcs to keep, and keep those that are no accident."""
    for arc in range(len(keep)):
        begin, end = begins[arc], begins[arc + 1]
        if keep[arc]:
            _evidence(piece_fits, found, members, begin, end, fits, arc, evidence.noise,
                      tolerance, rows)
            keep[arc] = rows[arc, SCORE] >= min_score
        if keep[arc]:
            if not extended[arc]:
                _extend(fits, arc, evidence, rows)
            _orient(fits, arc, members, begin, end, rows)


@compiled
def _gather(runs: np.ndarray, members: np.ndarray, begins: np.ndarray, keep: np.ndarray,
            pixels: np.ndarray, width: int, points: np.ndarray, offsets: np.ndarray,
            arc_pixels: np.ndarray, arc_points: np.ndarray) -> None:
    """Copy pixels and points of the arcs to keep, in order of travel."""
    n = arcs = 0
    for arc in range(len(keep)):
        if not keep[arc]:
            continue
        for k in range(begins[arc], begins[arc + 1]):
            first, last, step = runs[members[k, 0], 0], runs[members[k, 0], 1], 1
            if members[k, 1] == 1:
                first, last, step = last, first, -1
            for i in range(first, last + step, step):
                y = pixels[i] // width
                arc_pixels[n, 0], arc_pixels[n, 1] = pixels[i] - y * width, y
                arc_points[0, n], arc_points[1, n] = points[0, i], points[1, i]
                n += 1
        arcs += 1
        offsets[arcs] = n


def assemble(pieces: Pieces, joined: Joined, evidence: Evidence, pixels: np.ndarray,
             tolerance: float, min_length: float, min_score: float,
             min_distance: float) -> Found:
    """Find the arcs that are long enough, no accident, and not beside a longer one."""
    most = len(joined.fits)
    rows, (keep, extended) = np.zeros((most, COLUMNS)), np.empty((2, most), np.bool_)
    wanted, found = np.zeros(len(pieces.runs), np.bool_), np.empty((len(pieces.runs), WITNESSES))
    _describe(pieces.ends, evidence, *joined, min_length, rows, keep, extended,
              wanted)
    witness(evidence, pieces.runs, pieces.fits, wanted, found)
    _judge(pieces.fits, evidence, found, *joined, tolerance, min_score, extended, rows, keep)
    shape = evidence.dx.shape
    if min_distance > 0:
        separate(rows, joined.fits, shape[0], shape[1], min_distance, keep)
    kept = rows[keep]
    count = int(kept[:, SUPPORT].sum())
    offsets = np.zeros(len(kept) + 1, np.int64)
    arc_pixels, arc_points = np.empty((count, 2), np.int32), np.empty((2, count))
    _gather(pieces.runs, joined.members, joined.offsets, keep, pixels, shape[1], evidence.points,
            offsets, arc_pixels, arc_points)
    return Found(kept, arc_points, arc_pixels, offsets)
