"""
The last look at arcs: fitted anew without rounded corners, with standard deviations.

Where an edge ends at a corner, blur rounds it: the strongest gradient leaves the edge by
1.25 s (phi(y / s) / Phi(y / s))^2 at the distance y from the corner, for a total blur s of lens
and detector, which is less than s / 250 from 2 s on.  Those points are left out.

Noise moves the strongest gradient across a blurred step by its own derivative over the second
derivative of the gradient.  For white noise whose gradient has the standard deviation g after a
Gaussian d, and a step of gradient c, the variance of the position is 1.5 (g / c)^2 s^4 / d^2, and
its correlation along the edge exp(-t^2 / 4 d^2), whose integral is sqrt(4 pi) d: so many px
of points tell as much as one.  That is expected of each arc; its own residuals, summed in
blocks longer than that correlation, count besides it by their number.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.arcs import (
    Arcs, BENT, COLUMNS, CONTRAST, CURVATURE_STD, END, LENGTH, OFFSET_STD, RMS, START, SUPPORT,
    TABLE)
from qflsd_ros.core.circle import FIT_SIZE, Lens
from qflsd_ros.core.compilation import compiled, inlined, summed
from qflsd_ros.core.detection import noise
from qflsd_ros.core.detection.assembly import Found, is_inside, write_geometry
from qflsd_ros.core.detection.region import Region
from qflsd_ros.core.detection.validation import Evidence

CORNER = 2.0            # standard deviations of the blur that are left out at an end (see above)
# Points at the ends that are off the rest by less than so many times its own rms are none of a
# corner, and tell more than they mislead: without this 1 long line of 500 is lost on photographs.
OFF = 1.7
LEAST_POINTS = 8        # that remain: as many as the shortest piece has
SHIFT = 0.25            # px by which an arc's length may change; more belongs to no rounded corner
MOST_BLUR = 6.0         # px, total; chains of what is blurred more wander by more than it says
EVERY = 8               # edge points from one at which the blur is measured to the next
FARTHEST = 3            # px from the edge: parallel edges are often not much farther
ROUNDING = 0.35         # grey levels: that of the image and, blurred, of the detector, as noise
GRID = 0.015            # px, by which pixels displace sharp edges (measured on rendered ones)
BLOCK = 2.5             # correlation lengths in a block: so that blocks are independent
EXPECTED = 4.0          # blocks that weigh as much as what is expected: 3 to 8 change little
CURVE = 3.0             # of blocks: as many does the fit take up itself


@inlined
def _magnitude(dx: np.ndarray, dy: np.ndarray, row: int, column: int) -> float:
    """Return the gradient's magnitude, in Sobel's units."""
    gx, gy = float(dx[row, column]), float(dy[row, column])
    return math.sqrt(gx * gx + gy * gy)


@inlined
def _blur_within(pixels: np.ndarray, first: int, last: int, evidence: Evidence,
                 step: int) -> float:
    """
    Return the total blur of an edge, of lens and detector, px.

    A Gaussian falls by exp(-n^2 / 2 s^2), in the geometric mean of both sides, from a
    pixel to that ``step`` px along x or y, which is n px across the edge.
    """
    height, width = evidence.dx.shape
    beside = at = slant = 0.0
    # The same points whichever way the arc is travelled.
    for k in range(2 * ((last - first) // 2 // EVERY) + 2):
        away = k // 2 * EVERY + (last - first) // 2 % EVERY
        i = last - away if k % 2 else first + away
        x, y = pixels[i, 0], pixels[i, 1]
        if not (step <= x < width - step and step <= y < height - step):
            continue
        gx, gy = float(evidence.dx[y, x]), float(evidence.dy[y, x])
        u, v = (step, 0) if abs(gx) >= abs(gy) else (0, step)
        here = math.sqrt(gx * gx + gy * gy)
        beside += min(here, math.sqrt(_magnitude(evidence.dx, evidence.dy, y - v, x - u)
                                      * _magnitude(evidence.dx, evidence.dy, y + v, x + u)))
        at += here
        slant += step * step * max(gx * gx, gy * gy) / here
    fall = -2 * math.log(beside / at) if 0 < beside < at else 0.0
    return min(math.sqrt(slant / at / fall), MOST_BLUR) if fall > 0 else MOST_BLUR


@inlined
def _blur(pixels: np.ndarray, first: int, last: int, evidence: Evidence) -> float:
    """Return the total blur of an edge, px, as seen within about that distance of it."""
    blur = _blur_within(pixels, first, last, evidence, 1)
    step = min(int(blur), FARTHEST)
    # Noise moves maxima to where it is largest itself: close by, wide edges look sharp.
    return _blur_within(pixels, first, last, evidence, step) if step > 1 else blur


@inlined
def _inner(rows: np.ndarray, arc: int, first: int, last: int, blur: float) -> tuple[int, int]:
    """Return the first and last edge point without those near the ends."""
    count = last - first + 1
    dense = min(1.0, count / rows[arc, LENGTH])
    out = max(0, min(int(math.ceil(CORNER * blur * dense)), (count - LEAST_POINTS) // 2))
    return first + out, last - out


@inlined
def _expected(rows: np.ndarray, arc: int, blur: float, grain: float, least: float,
              together: float) -> float:
    """Return the variance of a point's position that noise makes, times ``together``, px^2."""
    part = grain / rows[arc, CONTRAST] * blur * blur / least
    return together * 1.5 * part * part + GRID * GRID


@summed
def _sum(points: np.ndarray, first: int, end: int, fits: np.ndarray) -> float:
    """Return the sum of the signed distances of edge points first to end - 1 from a fit, px."""
    total = 0.0
    for i in range(first, end):
        total += circle.value((fits[0, 2], fits[0, 3], fits[0, 4], fits[0, 5]),
                              points[0, i] - fits[0, 0], points[1, i] - fits[0, 1])
    return total


@summed
def _squares(points: np.ndarray, first: int, end: int, fits: np.ndarray) -> float:
    """Return the sum of squared distances of edge points first to end - 1 from a fit, px^2."""
    total = 0.0
    for i in range(first, end):
        off = circle.value((fits[0, 2], fits[0, 3], fits[0, 4], fits[0, 5]),
                           points[0, i] - fits[0, 0], points[1, i] - fits[0, 1])
        total += off * off
    return total


@inlined
def _scatter(points: np.ndarray, first: int, last: int, fits: np.ndarray, block: int) -> float:
    """Return the sum of squares of distances, summed in blocks, over the length of a block."""
    total = 0.0
    for begin in range(first, last + 1, block):
        total += _sum(points, begin, min(begin + block, last + 1), fits) ** 2
    return total / block


@inlined
def _variance(rows: np.ndarray, arc: int, points: np.ndarray, lo: int, hi: int,
              fits: np.ndarray, blur: float, grain: float, least: float) -> float:
    """Return the variance of a point, times how many tell as much as one, px^2."""
    dense = min(1.0, rows[arc, SUPPORT] / rows[arc, LENGTH])
    together = math.sqrt(4 * math.pi) * least * dense
    expected = _expected(rows, arc, blur, grain, least, together)
    block = max(1, int(BLOCK * together + 0.5))
    own = (hi - lo + 1) / block - CURVE
    if own <= 0:
        return expected
    return (EXPECTED * expected + _scatter(points, lo, hi, fits, block)) / (EXPECTED + own)


@inlined
def _ends_at_corners(points: np.ndarray, first: int, lo: int, hi: int, last: int,
                     fits: np.ndarray, tolerance: float) -> bool:
    """Return whether points at the ends are off a fit to the inner ones, lo to hi."""
    inner = fits[0, 6]
    outer = _squares(points, first, lo, fits) + _squares(points, hi + 1, last + 1, fits)
    count, out = last - first + 1, last - first - (hi - lo)
    return (outer * (count - out) > OFF * OFF * inner * out
            and inner + outer <= tolerance * tolerance * count)


@inlined
def _move(rows: np.ndarray, arc: int, fits: np.ndarray, rms: float, where: Region,
          moved: np.ndarray) -> None:
    """Let an arc lie on a fit, unless that leads out of the image or changes its length."""
    x0, y0, _, _ = circle.foot(fits, 0, rows[arc, START], rows[arc, START + 1])
    x1, y1, _, _ = circle.foot(fits, 0, rows[arc, END], rows[arc, END + 1])
    write_geometry(fits, 0, x0, y0, x1, y1, moved, 0)
    shift = abs(moved[0, LENGTH] - rows[arc, LENGTH])
    if shift > SHIFT or not is_inside(moved, 0, where):
        return
    for column in range(LENGTH + 1):
        rows[arc, column] = moved[0, column]
    rows[arc, RMS], rows[arc, CURVATURE_STD] = rms, 2 * math.sqrt(fits[0, 9])
    rows[arc, OFFSET_STD] = math.sqrt(fits[0, 10])


@compiled
def _refine(rows: np.ndarray, points: np.ndarray, pixels: np.ndarray, offsets: np.ndarray,
            evidence: Evidence, grain: float, least: float, tolerance: float,
            sharpest: float, lens: Lens, fits: np.ndarray, moved: np.ndarray) -> None:
    for arc in range(len(rows)):
        first, last = offsets[arc], offsets[arc + 1] - 1
        blur = _blur(pixels, first, last, evidence)
        lo, hi = _inner(rows, arc, first, last, blur)
        # All points have decided whether it is bent, those at its ends more than others.
        significance = 0.0 if rows[arc, BENT] > 0 else np.inf
        fitted = circle.fit(points, lo, hi, 0.0, significance, sharpest, lens, fits, 0)
        if not fitted:
            # The arc itself keeps the limit of curvature: only deviations are asked for.
            circle.fit(points, lo, hi, 0.0, significance, np.inf, lens, fits, 0)
        variance = _variance(rows, arc, points, lo, hi, fits, blur, grain, least)
        if fitted and _ends_at_corners(points, first, lo, hi, last, fits, tolerance):
            rms = math.sqrt(_squares(points, first, last + 1, fits) / (last - first + 1))
            _move(rows, arc, fits, rms, evidence.region, moved)
        rows[arc, CURVATURE_STD] *= math.sqrt(variance)
        rows[arc, OFFSET_STD] *= math.sqrt(variance)


@compiled
def _leave_out_short(found: Found, min_length: float) -> int:
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


def refine(found: Found, evidence: Evidence, tolerance: float, min_length: float,
           sharpest: float, lens: Lens) -> Arcs:
    """
    Return arcs fitted anew without rounded corners, with standard deviations.

    Parameters
    ----------
    found
        The arcs; their deviations are those that points of a deviation of 1 px would give.  All of
        its arrays are written to.
    evidence
        Of the image.
    tolerance
        Largest rms distance of the edge points from an arc, px.
    min_length
        Arcs that are shorter after the fit are left out, px.
    sharpest, lens
        As in :func:`circle.fit`.

    """
    least = math.hypot(evidence.blur, math.sqrt(noise.SOBEL_BLUR))
    grain = math.hypot(evidence.noise, noise.of_gradient(ROUNDING, evidence.blur))
    rows = found.rows
    _refine(rows, found.points, found.pixels, found.offsets, evidence, grain, least, tolerance,
            sharpest, lens, np.empty((1, FIT_SIZE)), np.empty((1, COLUMNS)))
    count = _leave_out_short(found, min_length)
    rows, offsets = rows[:count], found.offsets[:count + 1]
    table = rows.view(TABLE)[:, 0]
    table['support'], table['bent'] = rows[:, SUPPORT], rows[:, BENT]
    return Arcs(table, found.points.T[:offsets[-1]], found.pixels[:offsets[-1]], offsets)
