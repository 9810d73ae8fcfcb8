"""
Steps 2 to 5: arcs out of chains, by hypothesis and verification.

A hypothesis is the circle through three points of a window of a chain: its ends and its middle.
With a known lens it is the picture of the straight edge through its ends alone.  It is verified
outward from the middle and dropped at the first misfit.  The longest run is refitted by least
squares, as a circle of any curvature, and grown again, then taken out, and the pieces left are
searched on.

Windows have spans n, n / 2, n / 4, ... and begin every half span, so that each run of a chain that
is at least 1.5 spans long contains a whole window: at that span the probability P^K of equation
(12), that no hypothesis lies wholly within it, is 0, where the paper's random triples ask for
0.01.  Nothing is left to chance, and K is at most 4 n / span.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.circle import Lens, NO_LENS
from qflsd_ros.core.compilation import compiled, inlined

# Points times curvature of an arc at most: points are up to 1.41 px apart, and the picture of a
# straight edge never turns by more than half a turn (3.14).
MOST_TURN = 2.2
# Points for each px of an arc's chord at most; more are there where a chain turns back on itself.
CROWDED = 2.0
SECTION = 4096      # points of a chain that are searched at a time: its square bounds the time


@inlined
def _fits(model: circle.Circle, ox: float, oy: float, points: np.ndarray, i: int,
          tolerance: float) -> bool:
    return abs(circle.value(model, points[0, i] - ox, points[1, i] - oy)) <= tolerance


@inlined
def _run(model: circle.Circle, ox: float, oy: float, points: np.ndarray,
         first: int, last: int, middle: int, tolerance: float) -> tuple[int, int]:
    """Return the longest run around ``middle``, within first to last, that fits the model."""
    lo = hi = middle
    while hi < last and _fits(model, ox, oy, points, hi + 1, tolerance):
        hi += 1
    while lo > first and _fits(model, ox, oy, points, lo - 1, tolerance):
        lo -= 1
    return lo, hi


@inlined
def _model(points: np.ndarray, begin: int, middle: int, end: int, sharpest: float, lens: Lens,
           known: bool) -> tuple[circle.Circle, float, float, float]:
    """Return the circle through a window, its gradient's squared length, and its origin."""
    if known:
        lam, x, y = lens
        raw, square = circle.pictured(points[0, begin] - x, points[1, begin] - y,
                                      points[0, end] - x, points[1, end] - y, lam)
        return raw, square, x, y
    raw, square = circle.through(points[0, begin], points[1, begin], points[0, middle],
                                 points[1, middle], points[0, end], points[1, end], sharpest)
    return raw, square, points[0, middle], points[1, middle]


@inlined
def _hypothesis(points: np.ndarray, first: int, last: int, begin: int, end: int, tolerance: float,
                sharpest: float, lens: Lens, known: bool) -> tuple[int, int]:
    """Return the run within first to last that fits the circle through a window, or (0, -1)."""
    middle = (begin + end) // 2
    raw, square, ox, oy = _model(points, begin, middle, end, sharpest, lens, known)
    most = tolerance * tolerance * square
    farthest = 0.0
    for i in (middle, (begin + middle) // 2, (middle + end) // 2):
        off = circle.value(raw, points[0, i] - ox, points[1, i] - oy)
        farthest = max(farthest, off * off)
    if not farthest < most:
        return 0, -1
    return _run(circle.normalised(raw, square), ox, oy, points, first, last, middle, tolerance)


@inlined
def _longest(points: np.ndarray, first: int, last: int, span: int, tolerance: float,
             sharpest: float, lens: Lens, known: bool) -> tuple[int, int]:
    """Return the longest run that a window of ``span`` points finds within first to last."""
    best_lo, best_hi = 0, -1
    begin = first
    while True:
        begin = min(begin, last - span + 1)
        lo, hi = _hypothesis(points, first, last, begin, begin + span - 1, tolerance, sharpest,
                             lens, known)
        if hi - lo > best_hi - best_lo:
            best_lo, best_hi = lo, hi
        if begin == last - span + 1:
            return best_lo, best_hi
        begin = max(begin + span // 2, best_hi + 1 - span // 2)


@compiled
def _refit(points: np.ndarray, first: int, last: int, lo: int, hi: int,
           tolerance: float, significance: float, sharpest: float,
           fits: np.ndarray, row: int) -> tuple[int, int]:
    """Fit a run, grow it and fit again; return the run that was fitted last, or (0, -1)."""
    if not circle.fit(points, lo, hi, 0.0, significance, sharpest, NO_LENS, fits, row):
        return 0, -1
    model = (fits[row, 2], fits[row, 3], fits[row, 4], fits[row, 5])
    new_lo, new_hi = _run(model, fits[row, 0], fits[row, 1], points, first, last, (lo + hi) // 2,
                          tolerance)
    if new_lo != lo or new_hi != hi:
        lo, hi = new_lo, new_hi
        if not circle.fit(points, lo, hi, 0.0, significance, sharpest, NO_LENS, fits, row):
            return 0, -1
    bend = 2 * abs(fits[row, 2])
    if bend * (hi - lo) > MOST_TURN:
        hi = lo + int(MOST_TURN / bend)
        if not circle.fit(points, lo, hi, 0.0, significance, sharpest, NO_LENS, fits, row):
            return 0, -1
    advance = math.hypot(points[0, hi] - points[0, lo], points[1, hi] - points[1, lo])
    # What is bent more than it may be has been fitted by a line, and lies off it.
    off = fits[row, 6] > tolerance * tolerance * fits[row, 7]
    if hi - lo < 2 or hi - lo > CROWDED * advance or off:
        return 0, -1
    return lo, hi


@inlined
def _arc(points: np.ndarray, first: int, last: int, span: int, shortest: int, tolerance: float,
         significance: float, sharpest: float, lens: Lens, known: bool, fits: np.ndarray,
         row: int) -> tuple[int, int, int]:
    """
    Return the longest run within first to last that is an arc, and the span that found it.

    Spans are halved from the given one on; without an arc, the run is (0, -1).
    """
    span = min(span, last - first + 1)
    while span >= shortest:
        lo, hi = _longest(points, first, last, span, tolerance, sharpest, lens, known)
        if hi - lo + 1 >= span:
            lo, hi = _refit(points, first, last, lo, hi, tolerance, significance, sharpest, fits,
                            row)
            if hi - lo + 1 >= shortest:
                return lo, hi, span
        if span == shortest:
            break
        span = max(span // 2, shortest)
    return 0, -1, span


@compiled
def extract(points: np.ndarray, offsets: np.ndarray, chains: int, shortest: int,
            tolerance: float, significance: float, sharpest: float, lens: Lens, known: bool,
            todo: np.ndarray, runs: np.ndarray, fits: np.ndarray) -> int:
    """
    Find the arcs of all chains.

    Parameters
    ----------
    points
        (2, E) float32, x and y of the points of all chains, px.
    offsets, chains
        (chains + 1,) where each chain begins, and their number.
    shortest
        Arcs of fewer points are not looked for.
    tolerance
        Largest distance of a point from its arc, px.
    significance
        Curvature counts from this multiple of its standard deviation on.
    sharpest
        Largest curvature of an arc, 1/px.
    lens, known
        How the image is distorted, and whether that is known.
    todo
        (R, 3) int64, scratch; R >= E / shortest + 1.
    runs
        (R, 2) int64, takes the first and last point of every arc.
    fits
        (R, FIT_SIZE) float64, takes the fits.

    Returns
    -------
    Number of arcs.

    """
    found = 0
    for chain in range(chains):
        waiting = 0
        for first in range(offsets[chain], offsets[chain + 1], SECTION):
            last = min(first + SECTION, offsets[chain + 1]) - 1
            todo[waiting, 0], todo[waiting, 1], todo[waiting, 2] = first, last, last - first + 1
            waiting += 1
        while waiting > 0:
            waiting -= 1
            first, last = todo[waiting, 0], todo[waiting, 1]
            lo, hi, span = _arc(points, first, last, todo[waiting, 2], shortest, tolerance,
                                significance, sharpest, lens, known, fits, found)
            if hi < lo:
                continue
            runs[found, 0], runs[found, 1] = lo, hi
            found += 1
            for a, b in ((first, lo - 1), (hi + 1, last)):
                if b - a + 1 >= shortest:
                    todo[waiting, 0], todo[waiting, 1], todo[waiting, 2] = a, b, span
                    waiting += 1
    return found
