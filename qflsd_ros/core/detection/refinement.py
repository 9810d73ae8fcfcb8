"""
Refinement: each arc is fitted again without rounded corners, and gets its standard deviations.

Blur rounds the corner at the end of an edge.  At a distance y from the corner, the strongest
gradient is displaced from the edge by 1.25 s (phi(y / s) / Phi(y / s))^2 for a total blur s of
lens and detector: less than s / 250 from 2 s on.  The points closer to the end are left out of the
fit if they deviate.

Noise displaces the strongest gradient across a blurred step by the derivative of the noise over
the second derivative of the gradient.  For white noise with a standard deviation g of the gradient
after a Gaussian d, and a step of gradient c, the variance of the position is
1.5 (g / c)^2 s^4 / d^2.  Its correlation along the edge is exp(-t^2 / 4 d^2), whose integral
sqrt(4 pi) d is the distance in px between independent points.  This is the expected variance.  The
residuals of the arc, summed in blocks longer than the correlation, are weighted against it by
their number.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.arcs import (
    Arcs, BENT, COLUMNS, CONTRAST, CURVATURE_STD, END, LENGTH, OFFSET_STD, RMS, START, SUPPORT,
    TABLE)
from qflsd_ros.core.circle import CurvatureLimits, FIT_SIZE
from qflsd_ros.core.compilation import compiled, inlined, summed
from qflsd_ros.core.detection.assembly import Found, is_inside, write_geometry
from qflsd_ros.core.detection.contours import noise
from qflsd_ros.core.detection.frame import Frame, Limits
from qflsd_ros.core.detection.region import Region

# All of these are chosen, not tuned, unless stated otherwise.
CORNER = 2.0            # length that is left out at an end, in total blurs (see above)
# Points at the ends are those of a corner if their rms distance is so many times that of the
# others.  Without this limit one long line of 500 on photographs is lost.
OFF = 1.7
LEAST_POINTS = 8        # points of a fit, at least: those of the shortest piece
SHIFT = 0.25            # px by which refinement changes the length; no rounded corner needs more
MOST_BLUR = 6.0         # px, total; chains in more blurred images deviate by more than expected
EVERY = 8               # edge points between two measurements of the blur
FARTHEST = 3            # px from the edge to measure the blur: parallel edges are often close
ROUNDING = 0.35         # grey levels: standard deviation of rounding of the image and after blur
GRID = 0.015            # px by which the pixel grid displaces sharp edges (on rendered edges)
BLOCK = 2.5             # correlation lengths of a block, so that blocks are independent
EXPECTED = 4.0          # blocks that the expected variance counts for: 3 to 8 change little
CURVE = 3.0             # degrees of freedom of the fit


class Blur(NamedTuple):
    """The noise of the gradients and the blur of the detector."""

    noise: float        # standard deviation of dx and dy, rounding included, grey levels
    least: float        # standard deviation of the Gaussian whose derivative the gradients are, px


@inlined
def _magnitude(dx: np.ndarray, dy: np.ndarray, row: int, column: int) -> float:
    """Return the gradient's magnitude, in Sobel's units."""
    gx, gy = float(dx[row, column]), float(dy[row, column])
    return math.sqrt(gx * gx + gy * gy)


@inlined
def _blur_within(pixels: np.ndarray, first: int, last: int, frame: Frame,
                 step: int) -> float:
    """
    Return the total blur of an edge, of lens and detector, px.

    A Gaussian falls by exp(-n^2 / 2 s^2) over a distance n across the edge.  The fall is measured
    as the geometric mean of both sides, ``step`` px away along x or y.
    """
    height, width = frame.dx.shape
    beside = at = slant = 0.0
    # The same points whichever way the arc is travelled.
    for k in range(2 * ((last - first) // 2 // EVERY) + 2):
        away = k // 2 * EVERY + (last - first) // 2 % EVERY
        i = last - away if k % 2 else first + away
        x, y = pixels[i, 0], pixels[i, 1]
        if not (step <= x < width - step and step <= y < height - step):
            continue
        gx, gy = float(frame.dx[y, x]), float(frame.dy[y, x])
        u, v = (step, 0) if abs(gx) >= abs(gy) else (0, step)
        here = math.sqrt(gx * gx + gy * gy)
        beside += min(here, math.sqrt(_magnitude(frame.dx, frame.dy, y - v, x - u)
                                      * _magnitude(frame.dx, frame.dy, y + v, x + u)))
        at += here
        slant += step * step * max(gx * gx, gy * gy) / here
    fall = -2 * math.log(beside / at) if 0 < beside < at else 0.0
    return min(math.sqrt(slant / at / fall), MOST_BLUR) if fall > 0 else MOST_BLUR


@inlined
def _blur(pixels: np.ndarray, first: int, last: int, frame: Frame) -> float:
    """Return the total blur of an edge, px, measured at a distance of about one blur from it."""
    blur = _blur_within(pixels, first, last, frame, 1)
    step = min(int(blur), FARTHEST)
    # Noise has maxima of its own, close to which a wide edge appears sharp.
    return _blur_within(pixels, first, last, frame, step) if step > 1 else blur


@inlined
def _inner(rows: np.ndarray, arc: int, span: tuple[int, int], blur: float) -> tuple[int, int]:
    """Return the span of edge points without those near the ends."""
    first, last = span
    count = last - first + 1
    dense = min(1.0, count / rows[arc, LENGTH])
    out = max(0, min(int(math.ceil(CORNER * blur * dense)), (count - LEAST_POINTS) // 2))
    return first + out, last - out


@inlined
def _expected(rows: np.ndarray, arc: int, total: float, blur: Blur, together: float) -> float:
    """Return the expected variance of a point for a total blur, times ``together``, px^2."""
    part = blur.noise / rows[arc, CONTRAST] * total * total / blur.least
    return together * 1.5 * part * part + GRID * GRID


@summed
def _sum(points: np.ndarray, first: int, end: int, fits: np.ndarray) -> float:
    """Return the sum of the signed distances of edge points first to end - 1 from a fit, px."""
    total = 0.0
    for i in range(first, end):
        total += circle.value_at(fits, 0, points[0, i], points[1, i])
    return total


@summed
def _squares(points: np.ndarray, first: int, end: int, fits: np.ndarray) -> float:
    """Return the sum of squared distances of edge points first to end - 1 from a fit, px^2."""
    total = 0.0
    for i in range(first, end):
        off = circle.value_at(fits, 0, points[0, i], points[1, i])
        total += off * off
    return total


@inlined
def _scatter(points: np.ndarray, span: tuple[int, int], fits: np.ndarray, block: int) -> float:
    """Return the sum over blocks of the squared sum of distances, divided by a block's length."""
    total = 0.0
    for begin in range(span[0], span[1] + 1, block):
        total += _sum(points, begin, min(begin + block, span[1] + 1), fits) ** 2
    return total / block


@inlined
def _variance(found: Found, arc: int, span: tuple[int, int], fits: np.ndarray, total: float,
              blur: Blur) -> float:
    """Return the variance of a point times the number of points that share an error, px^2."""
    rows = found.rows
    dense = min(1.0, rows[arc, SUPPORT] / rows[arc, LENGTH])
    together = math.sqrt(4 * math.pi) * blur.least * dense
    expected = _expected(rows, arc, total, blur, together)
    block = max(1, int(BLOCK * together + 0.5))
    own = (span[1] - span[0] + 1) / block - CURVE
    if own <= 0:
        return expected
    scatter = _scatter(found.points, span, fits, block)
    return (EXPECTED * expected + scatter) / (EXPECTED + own)


@inlined
def _ends_at_corners(points: np.ndarray, span: tuple[int, int], inner: tuple[int, int],
                     fits: np.ndarray, tolerance: float) -> bool:
    """Return whether the points at the ends are off the fit to the inner span."""
    (first, last), (lo, hi) = span, inner
    squares = fits[0, circle.RSS]
    outer = _squares(points, first, lo, fits) + _squares(points, hi + 1, last + 1, fits)
    count, out = last - first + 1, last - first - (hi - lo)
    return (outer * (count - out) > OFF * OFF * squares * out
            and squares + outer <= tolerance * tolerance * count)


@inlined
def _move(rows: np.ndarray, arc: int, fits: np.ndarray, rms: float, region: Region,
          moved: np.ndarray) -> None:
    """Move an arc to a fit, unless that leads out of the image or changes its length."""
    x0, y0, _, _ = circle.foot(fits, 0, rows[arc, START], rows[arc, START + 1])
    x1, y1, _, _ = circle.foot(fits, 0, rows[arc, END], rows[arc, END + 1])
    write_geometry(fits, 0, (x0, y0), (x1, y1), moved, 0)
    shift = abs(moved[0, LENGTH] - rows[arc, LENGTH])
    if shift > SHIFT or not is_inside(moved, 0, region):
        return
    for column in range(LENGTH + 1):
        rows[arc, column] = moved[0, column]
    rows[arc, RMS], rows[arc, CURVATURE_STD] = rms, 2 * math.sqrt(fits[0, circle.LEVER_A])
    rows[arc, OFFSET_STD] = math.sqrt(fits[0, circle.LEVER_D])


@compiled
def _refine_one(found: Found, arc: int, frame: Frame, blur: Blur, limits: Limits,
                memory: tuple[np.ndarray, np.ndarray]) -> None:
    """Refine an arc; ``memory`` is a (1, FIT_SIZE) and a (1, COLUMNS) array."""
    rows, points, pixels, offsets = found
    fits, moved = memory
    first, last = offsets[arc], offsets[arc + 1] - 1
    total = _blur(pixels, first, last, frame)
    inner = _inner(rows, arc, (first, last), total)
    # Whether the arc is bent was decided by all points, as its ends have the longest lever.
    significance = 0.0 if rows[arc, BENT] > 0 else np.inf
    bend = CurvatureLimits(significance, limits.bend.maximum, limits.bend.lens)
    fitted = circle.fit(points, inner, 0.0, bend, fits, 0)
    if not fitted:
        # The arc keeps its place; this fit gives its standard deviations alone.
        bend = CurvatureLimits(significance, np.inf, limits.bend.lens)
        circle.fit(points, inner, 0.0, bend, fits, 0)
    variance = _variance(found, arc, inner, fits, total, blur)
    if fitted and _ends_at_corners(points, (first, last), inner, fits, limits.tolerance):
        rms = math.sqrt(_squares(points, first, last + 1, fits) / (last - first + 1))
        _move(rows, arc, fits, rms, frame.region, moved)
    rows[arc, CURVATURE_STD] *= math.sqrt(variance)
    rows[arc, OFFSET_STD] *= math.sqrt(variance)


@compiled
def _refine(found: Found, frame: Frame, blur: Blur, limits: Limits,
            memory: tuple[np.ndarray, np.ndarray]) -> None:
    for arc in range(len(found.rows)):
        _refine_one(found, arc, frame, blur, limits, memory)


@compiled
def _drop_short(found: Found, min_length: float) -> int:
    """Move the arcs of at least ``min_length`` px to the front, in order; return their number."""
    kept = filled = 0
    for arc in range(len(found.rows)):
        first, last = found.offsets[arc], found.offsets[arc + 1]
        if found.rows[arc, LENGTH] < min_length:
            continue
        if kept < arc:
            for column in range(COLUMNS):
                found.rows[kept, column] = found.rows[arc, column]
            for i in range(first, last):
                to = filled + i - first
                found.points[0, to], found.points[1, to] = found.points[0, i], found.points[1, i]
                found.pixels[to, 0], found.pixels[to, 1] = found.pixels[i, 0], found.pixels[i, 1]
        kept += 1
        filled += last - first
        found.offsets[kept] = filled
    return kept


def refine(found: Found, frame: Frame, limits: Limits) -> Arcs:
    """
    Return the arcs, fitted again without rounded corners, with their standard deviations.

    Parameters
    ----------
    found
        The arcs; their standard deviations are those for points of 1 px.  All of its arrays are
        overwritten.
    frame
        The image.
    limits
        Limits of the frame; arcs shorter than its ``min_length`` after the fit are left out.

    """
    blur = Blur(math.hypot(frame.noise, noise.of_gradient(ROUNDING, frame.blur)),
                math.hypot(frame.blur, math.sqrt(noise.SOBEL_BLUR)))
    _refine(found, frame, blur, limits, (np.empty((1, FIT_SIZE)), np.empty((1, COLUMNS))))
    count = _drop_short(found, limits.min_length)
    rows, offsets = found.rows[:count], found.offsets[:count + 1]
    table = rows.view(TABLE)[:, 0]
    table['support'], table['bent'] = rows[:, SUPPORT], rows[:, BENT]
    return Arcs(table, found.points.T[:offsets[-1]], found.pixels[:offsets[-1]], offsets)
