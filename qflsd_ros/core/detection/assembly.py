"""Step 6: the set of all arcs, each with its row in the table, its edge pixels and points."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.arcs import (
    BENT, COLUMNS, CONTRAST, CURVATURE, CURVATURE_STD, END, LENGTH, MIDDLE, OFFSET_STD, POLARITY,
    RMS, SCORE, START, SUPPORT)
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection import validation
from qflsd_ros.core.detection.extension import extended, FARTHEST
from qflsd_ros.core.detection.frame import Frame, Limits
from qflsd_ros.core.detection.joining.agreement import MAX_TURN
from qflsd_ros.core.detection.joining.joining import Joined
from qflsd_ros.core.detection.joining.pieces import Pieces
from qflsd_ros.core.detection.region import COMPARED, Disc, is_open, Region, SAMPLED
from qflsd_ros.core.detection.suppression import suppress


class Found(NamedTuple):
    """M arcs and the N edge points behind them."""

    rows: np.ndarray        # (M, COLUMNS) float64; standard deviations as for points of 1 px
    points: np.ndarray      # (2, N) float64, px
    pixels: np.ndarray      # (N, 2) int32, x and y
    offsets: np.ndarray     # (M + 1,) int64


class Candidates(NamedTuple):
    """M joined arcs during assembly."""

    fits: np.ndarray        # (M, FIT_SIZE) float64
    members: np.ndarray     # (P, 2) int64: piece, and 1 if it is travelled from end to start
    begins: np.ndarray      # (M + 1,) int64: where in members each arc begins
    rows: np.ndarray        # (M, COLUMNS) float64
    keep: np.ndarray        # (M,) bool
    extended: np.ndarray    # (M,) bool: whether the ends have been extended


@inlined
def write_geometry(fits: np.ndarray, fit: int, start: tuple[float, float],
                   end: tuple[float, float], rows: np.ndarray, arc: int) -> None:
    """Write the geometry of the arc between two points of a fit to a row of the table."""
    x, y, curvature, length = circle.arc_between(fits, fit, start[0], start[1], end[0], end[1])
    rows[arc, START], rows[arc, START + 1] = start
    rows[arc, MIDDLE], rows[arc, MIDDLE + 1] = x, y
    rows[arc, END], rows[arc, END + 1] = end
    rows[arc, CURVATURE], rows[arc, LENGTH] = curvature, length


@compiled
def _avoids_mask(rows: np.ndarray, arc: int, allowed: np.ndarray) -> bool:
    """Return whether no point of an arc is on a masked pixel, by points SAMPLED apart."""
    x0, y0 = rows[arc, START], rows[arc, START + 1]
    cx, cy = rows[arc, END] - x0, rows[arc, END + 1] - y0
    half = rows[arc, CURVATURE] * rows[arc, LENGTH] / 2
    steps = int(math.ceil(rows[arc, LENGTH] / SAMPLED))
    for i in range(steps + 1):
        # The whole arc turns by 2 h (``half``).  Its part up to a turn of 2 p has a chord that is
        # the whole chord, turned by p - h and scaled by sin(p) / sin(h).
        part = half * i / steps
        along = math.sin(part) / math.sin(half) if abs(half) > 1e-9 else i / steps
        c, s = along * math.cos(part - half), along * math.sin(part - half)
        if not is_open(allowed, x0 + c * cx - s * cy, y0 + c * cy + s * cx):
            return False
    return True


@inlined
def _is_within(rows: np.ndarray, arc: int, disc: Disc) -> bool:
    """Return whether all pixels that are compared with a mask for an arc surely lie in a disc."""
    turn = abs(rows[arc, CURVATURE]) * rows[arc, LENGTH]
    if turn > math.pi:
        return False
    # No point of half a circle or less is farther from the chord than the middle.
    sagitta = rows[arc, LENGTH] * turn / 8
    for place in (START, END):
        x, y = rows[arc, place] - disc.x, rows[arc, place + 1] - disc.y
        if math.hypot(x, y) + sagitta + COMPARED > disc.radius:
            return False
    return True


@inlined
def is_inside(rows: np.ndarray, arc: int, region: Region) -> bool:
    """Return whether an arc lies in the image, within half a pixel, and on no masked pixel."""
    height, width = region.allowed.shape
    for place in (START, MIDDLE, END):
        x, y = rows[arc, place], rows[arc, place + 1]
        if not (-0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5):
            return False
    return (not region.masked or _is_within(rows, arc, region.clear)
            or _avoids_mask(rows, arc, region.allowed))


@inlined
def _extend(fits: np.ndarray, arc: int, frame: Frame, rows: np.ndarray) -> None:
    """Extend both ends of an arc where they stay in the image and off the mask."""
    if (rows[arc, LENGTH] + 2 * FARTHEST) * abs(rows[arc, CURVATURE]) > MAX_TURN:
        return
    start = (rows[arc, START], rows[arc, START + 1])
    end = (rows[arc, END], rows[arc, END + 1])
    write_geometry(fits, arc, extended(fits, arc, frame, start, end),
                   extended(fits, arc, frame, end, start), rows, arc)
    if not is_inside(rows, arc, frame.region):
        write_geometry(fits, arc, start, end, rows, arc)


@inlined
def _same_side(piece_fits: np.ndarray, piece: int, fits: np.ndarray, arc: int) -> bool:
    """Return whether P of a piece and P of its arc grow to the same side."""
    nx, ny = circle.normal_at(fits, arc, piece_fits[piece, circle.X0],
                              piece_fits[piece, circle.Y0])
    return piece_fits[piece, circle.B] * nx + piece_fits[piece, circle.C] * ny > 0


@inlined
def _score(found: Candidates, arc: int, piece_fits: np.ndarray, support: np.ndarray,
           noise: float, tolerance: float) -> None:
    """Write contrast, score and polarity: the share of points where P grows, less the others."""
    weight, aligned, steps, signs, samples, strong = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    rows = found.rows
    for k in range(found.begins[arc], found.begins[arc + 1]):
        piece = found.members[k, 0]
        weight += support[piece, validation.WEIGHT]
        aligned += support[piece, validation.ALIGNED]
        steps += support[piece, validation.STEPS]
        samples += support[piece, validation.SAMPLES]
        strong += support[piece, validation.STRONG]
        same = _same_side(piece_fits, piece, found.fits, arc)
        signs += support[piece, validation.SIGNS] if same else -support[piece, validation.SIGNS]
    rows[arc, CONTRAST] = steps / rows[arc, SUPPORT]
    rows[arc, POLARITY] = signs / rows[arc, SUPPORT]
    rows[arc, SCORE] = (validation.score(weight, aligned, strong / max(samples, 1.0), len(rows))
                        + validation.closeness(rows[arc, SUPPORT], rows[arc, RMS],
                                               noise / rows[arc, CONTRAST], tolerance))


@compiled
def _orient(found: Candidates, arc: int) -> None:
    """Direct travel so that the brighter side is on the right, at larger y for travel along x."""
    rows, fits, members = found.rows, found.fits, found.members
    begin, end = found.begins[arc], found.begins[arc + 1]
    cx = rows[arc, END] - rows[arc, START]
    cy = rows[arc, END + 1] - rows[arc, START + 1]
    if fits[arc, circle.C] * cx < fits[arc, circle.B] * cy:
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


@inlined
def _describe(found: Candidates, arc: int, ends: np.ndarray) -> None:
    """Write the row of an arc, as far as it follows from the fit."""
    rows, fits, members = found.rows, found.fits, found.members
    begin, end = found.begins[arc], found.begins[arc + 1]
    first = 2 * members[begin, 0] + members[begin, 1]
    last = 2 * members[end - 1, 0] + 1 - members[end - 1, 1]
    x0, y0, _, _ = circle.foot(fits, arc, ends[first, 0], ends[first, 1])
    x1, y1, _, _ = circle.foot(fits, arc, ends[last, 0], ends[last, 1])
    write_geometry(fits, arc, (x0, y0), (x1, y1), rows, arc)
    rows[arc, RMS] = math.sqrt(fits[arc, circle.RSS] / fits[arc, circle.COUNT])
    # The count of the fit is a sum of quadrature weights: an integer up to rounding.
    rows[arc, SUPPORT] = np.rint(fits[arc, circle.COUNT])
    rows[arc, CURVATURE_STD] = 2 * math.sqrt(fits[arc, circle.LEVER_A])
    rows[arc, OFFSET_STD] = math.sqrt(fits[arc, circle.LEVER_D])
    rows[arc, BENT] = fits[arc, circle.BENT]


@compiled
def _select(found: Candidates, ends: np.ndarray, frame: Frame, min_length: float,
            wanted: np.ndarray) -> None:
    """
    Write the rows of all arcs; keep those that are long enough, and mark their pieces.

    An arc far from its points, as a large tolerance allows, may lie outside the image or on a
    mask, and is not kept.  Only arcs below ``min_length`` are extended here: the others wait
    until they are validated, which saves time.
    """
    rows, keep = found.rows, found.keep
    for arc in range(len(keep)):
        _describe(found, arc, ends)
        keep[arc] = is_inside(rows, arc, frame.region)
        found.extended[arc] = keep[arc] and rows[arc, LENGTH] < min_length
        if found.extended[arc]:
            _extend(found.fits, arc, frame, rows)
            keep[arc] = rows[arc, LENGTH] >= min_length
        for k in range(found.begins[arc], found.begins[arc + 1]):
            wanted[found.members[k, 0]] = keep[arc]


@compiled
def _validate(found: Candidates, piece_fits: np.ndarray, support: np.ndarray, frame: Frame,
              limits: Limits) -> None:
    """Keep the arcs with a sufficient score, extend their ends and direct them."""
    rows, keep = found.rows, found.keep
    for arc in range(len(keep)):
        if keep[arc]:
            _score(found, arc, piece_fits, support, frame.noise, limits.tolerance)
            keep[arc] = rows[arc, SCORE] >= limits.min_score
        if keep[arc]:
            if not found.extended[arc]:
                _extend(found.fits, arc, frame, rows)
            _orient(found, arc)


@compiled
def _gather(found: Candidates, runs: np.ndarray, points: np.ndarray, pixels: np.ndarray,
            width: int, kept: Found) -> None:
    """Copy edge pixels and points of the arcs to keep, in order of travel."""
    n = arcs = 0
    for arc in range(len(found.keep)):
        if not found.keep[arc]:
            continue
        for k in range(found.begins[arc], found.begins[arc + 1]):
            first, last, step = runs[found.members[k, 0], 0], runs[found.members[k, 0], 1], 1
            if found.members[k, 1] == 1:
                first, last, step = last, first, -1
            for i in range(first, last + step, step):
                y = pixels[i] // width
                kept.pixels[n, 0], kept.pixels[n, 1] = pixels[i] - y * width, y
                kept.points[0, n], kept.points[1, n] = points[0, i], points[1, i]
                n += 1
        arcs += 1
        kept.offsets[arcs] = n


def candidates(pieces: Pieces, joined: Joined) -> Candidates:
    """Return the joined arcs, with memory for their rows."""
    count = len(joined.fits)
    return Candidates(joined.fits, joined.members, joined.offsets, np.zeros((count, COLUMNS)),
                      np.empty(count, np.bool_), np.empty(count, np.bool_))


def validate(found: Candidates, pieces: Pieces, points: np.ndarray, frame: Frame,
             limits: Limits, min_length: float) -> None:
    """Keep the arcs that are long enough and supported by the image, and extend their ends."""
    wanted = np.zeros(len(pieces.runs), np.bool_)
    support = np.empty((len(pieces.runs), validation.SUPPORT_SIZE))
    _select(found, pieces.ends, frame, min_length, wanted)
    validation.gradient_support(frame, points, pieces.runs, pieces.fits, wanted, support)
    _validate(found, pieces.fits, support, frame, limits)


def separate(found: Candidates, shape: tuple[int, int], min_distance: float) -> None:
    """Suppress arcs beside longer ones; with a ``min_distance`` of 0 all are kept."""
    if min_distance > 0:
        suppress(found.rows, found.fits, shape, min_distance, found.keep)


def gather(found: Candidates, runs: np.ndarray, points: np.ndarray, pixels: np.ndarray,
           width: int) -> Found:
    """Return the kept arcs with their edge pixels and points."""
    rows = found.rows[found.keep]
    count = int(rows[:, SUPPORT].sum())
    kept = Found(rows, np.empty((2, count)), np.empty((count, 2), np.int32),
                 np.zeros(len(rows) + 1, np.int64))
    _gather(found, runs, points, pixels, width, kept)
    return kept
