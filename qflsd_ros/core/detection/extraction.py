"""
Steps 2 to 5: arcs out of chains, by hypothesis and verification.

A hypothesis is the circle through three points of a window of a chain: its first, middle and last
point.  With a known lens it is the image of the line through the first and last point.  It is
verified from the middle outward, up to the first point that is farther off than the tolerance.
The longest run is fitted by least squares, extended, and removed from the chain; the remainders
are searched in the same way.

Windows have spans n, n / 2, n / 4, ... and begin every half span, so that each run of a chain of
1.5 spans or more contains a whole window.  At that span, the probability P^K of equation (12),
that no hypothesis lies within the run, is 0; the random triples of the paper make it 0.01.  The
search is deterministic, and K is at most 4 n / span.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.circle import Circle
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.frame import Limits
from qflsd_ros.core.detection.spacing import place

# All of these are chosen, not tuned, unless stated otherwise.
# Radians by which an arc may turn, taking a point for each px: points are up to 1.41 px apart,
# and the image of a line turns by less than pi.
MAX_TURN = 2.2
CROWDED = 2.0           # points per px of chord, at most; a chain that turns back has more
SECTION = 4096          # points that are searched together, which bounds the time (its square)

Model = tuple[Circle, float, float]     # a circle, and its origin in the image
Span = tuple[int, int]                  # first and last point, both included
NO_RUN = 0, -1                          # the span without a point


@inlined
def _fits(model: Model, points: np.ndarray, i: int, tolerance: float) -> bool:
    curve, ox, oy = model
    return abs(circle.value(curve, points[0, i] - ox, points[1, i] - oy)) <= tolerance


@inlined
def _run(model: Model, points: np.ndarray, bounds: Span, around: Span, tolerance: float) -> Span:
    """Return the longest run around the middle of a span, within bounds, that fits the model."""
    lo, hi = (around[0] + around[1]) // 2, (around[0] + around[1] + 1) // 2
    while hi < bounds[1] and _fits(model, points, hi + 1, tolerance):
        hi += 1
    while lo > bounds[0] and _fits(model, points, lo - 1, tolerance):
        lo -= 1
    return lo, hi


@inlined
def _model(points: np.ndarray, window: Span, limits: Limits) -> tuple[Model, float]:
    """Return the circle through a window, and its gradient's squared length."""
    begin, end = window
    middle = (begin + end) // 2
    if circle.is_known(limits.bend.lens):
        lens = limits.bend.lens
        raw, square = circle.image_of_line(
            (points[0, begin] - lens.x, points[1, begin] - lens.y),
            (points[0, end] - lens.x, points[1, end] - lens.y), lens.lam)
        return (raw, lens.x, lens.y), square
    raw, square = circle.through(
        (points[0, begin], points[1, begin]), (points[0, middle], points[1, middle]),
        (points[0, end], points[1, end]), limits.bend.maximum)
    return (raw, float(points[0, middle]), float(points[1, middle])), square


@inlined
def _hypothesis(points: np.ndarray, bounds: Span, window: Span, limits: Limits) -> Span:
    """Return the run within bounds that fits the circle through a window, or NO_RUN."""
    begin, end = window
    middle, quarter = (begin + end) // 2, (end - begin) // 4
    (raw, ox, oy), square = _model(points, window, limits)
    farthest = 0.0
    for i in (middle, begin + quarter, end - quarter):
        off = circle.value(raw, points[0, i] - ox, points[1, i] - oy)
        farthest = max(farthest, off * off)
    if not farthest < limits.tolerance * limits.tolerance * square:
        return NO_RUN
    model = (circle.normalised(raw, square), ox, oy)
    return _run(model, points, bounds, window, limits.tolerance)


@inlined
def _strength(points: np.ndarray, lo: int, hi: int) -> float:
    """Return the squared gradients at both ends of a run, which decide between equal lengths."""
    return float(points[2, lo] ** 2 + points[3, lo] ** 2 + points[2, hi] ** 2 + points[3, hi] ** 2)


@inlined
def _longest(points: np.ndarray, bounds: Span, span: int, limits: Limits) -> Span:
    """Return the longest run that a window of ``span`` points finds within bounds."""
    best_lo, best_hi = NO_RUN
    room = bounds[1] + 1 - bounds[0] - span
    # Windows begin half a span apart at most; their number is even, so that none lies in the
    # middle, unless one window holds all.
    steps = 2 * room // span | 1
    for i in range(steps + 1 if room > 0 else 1):
        begin = bounds[0] + place(i, room, steps)
        lo, hi = _hypothesis(points, bounds, (begin, begin + span - 1), limits)
        longer = (hi - lo) - (best_hi - best_lo)
        if longer > 0 or longer == 0 and _strength(points, lo, hi) > _strength(points, best_lo,
                                                                               best_hi):
            best_lo, best_hi = lo, hi
    return best_lo, best_hi


@compiled
def _refit(points: np.ndarray, bounds: Span, run: Span, limits: Limits, fits: np.ndarray,
           row: int) -> Span:
    """Fit a run, extend it and fit again; return the run of the last fit, or NO_RUN."""
    lo, hi = run
    if not circle.fit(points, run, 0.0, limits.free_bend, fits, row):
        return NO_RUN
    model = (circle.curve(fits, row), fits[row, circle.X0], fits[row, circle.Y0])
    lo, hi = _run(model, points, bounds, run, limits.tolerance)
    if (lo, hi) != run and not circle.fit(points, (lo, hi), 0.0, limits.free_bend, fits, row):
        return NO_RUN
    bend = 2 * abs(fits[row, circle.A])
    if bend * (hi - lo) > MAX_TURN:
        hi = lo + int(MAX_TURN / bend)
        if not circle.fit(points, (lo, hi), 0.0, limits.free_bend, fits, row):
            return NO_RUN
    chord = math.hypot(points[0, hi] - points[0, lo], points[1, hi] - points[1, lo])
    # A line was fitted to a run above the maximum curvature; the run is far from that line.
    off = fits[row, circle.RSS] > limits.tolerance * limits.tolerance * fits[row, circle.COUNT]
    if hi - lo < 2 or hi - lo > CROWDED * chord or off:
        return NO_RUN
    return lo, hi


@inlined
def _odd(n: int) -> int:
    """Return the largest odd number up to n: a window of so many points has a middle."""
    return n - 1 + n % 2


@inlined
def _arc(points: np.ndarray, bounds: Span, span: int, limits: Limits, fits: np.ndarray,
         row: int) -> tuple[Span, int]:
    """
    Return the longest run within bounds that is an arc, or NO_RUN, and the span that found it.

    Spans are halved, beginning with the given one.
    """
    shortest = _odd(limits.min_points)
    span = _odd(min(span, bounds[1] - bounds[0] + 1))
    while span >= shortest:
        lo, hi = _longest(points, bounds, span, limits)
        if hi - lo + 1 >= span:
            lo, hi = _refit(points, bounds, (lo, hi), limits, fits, row)
            if hi - lo + 1 >= limits.min_points:
                return (lo, hi), span
        if span == shortest:
            break
        span = max(_odd(span // 2), shortest)
    return NO_RUN, span


@compiled
def extract(points: np.ndarray, offsets: np.ndarray, limits: Limits, todo: np.ndarray,
            runs: np.ndarray, fits: np.ndarray) -> int:
    """
    Find the arcs of all chains.

    Parameters
    ----------
    points
        (4, E) float32, x and y of the points of all chains, px, and the gradients there.
    offsets
        (chains + 1,) int64: the first point of each chain, and the number of points.
    limits
        Limits of the frame.
    todo
        (R, 3) int64, working memory; R >= E / limits.min_points + 1.
    runs
        (R, 2) int64, receives the first and last point of every arc.
    fits
        (R, FIT_SIZE) float64, receives the fits.

    Returns
    -------
    Number of arcs.

    """
    found = 0
    for chain in range(len(offsets) - 1):
        waiting = 0
        for first in range(offsets[chain], offsets[chain + 1], SECTION):
            last = min(first + SECTION, offsets[chain + 1]) - 1
            todo[waiting, 0], todo[waiting, 1], todo[waiting, 2] = first, last, last - first + 1
            waiting += 1
        while waiting > 0:
            waiting -= 1
            first, last = todo[waiting, 0], todo[waiting, 1]
            (lo, hi), span = _arc(points, (first, last), todo[waiting, 2], limits, fits, found)
            if hi < lo:
                continue
            runs[found, 0], runs[found, 1] = lo, hi
            found += 1
            for a, b in ((first, lo - 1), (hi + 1, last)):
                if b - a + 1 >= limits.min_points:
                    todo[waiting, 0], todo[waiting, 1], todo[waiting, 2] = a, b, span
                    waiting += 1
    return found
