"""
The published search for segments (Algorithm 1), compiled, with distances in px.

Triples of points are drawn anywhere on a chain, until the probability that all of them have missed
a run as long as the longest so far is below 0.01 (equations (11) and (12)).
"""
from __future__ import annotations

import math

import numba
import numpy as np

ALL_MISS = 0.01             # P^K of equation (12)
MOST = 2000                 # hypotheses on a chain, as in config/paper.yaml


@numba.njit
def _circle(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[float, float, float]:
    """Return A, B, C of A (x^2 + y^2) + B x + C y = 0 through three points, from ``b``."""
    ax, ay, cx, cy = a[0] - b[0], a[1] - b[1], c[0] - b[0], c[1] - b[1]
    a2, c2 = ax * ax + ay * ay, cx * cx + cy * cy
    B, C = ay * c2 - a2 * cy, a2 * cx - ax * c2
    norm = math.sqrt(B * B + C * C)
    if norm == 0:           # the contour passes the same pixel twice: no circle
        return math.nan, math.nan, math.nan
    return (ax * cy - ay * cx) / norm, B / norm, C / norm


@numba.njit
def _run(points: np.ndarray, first: int, last: int, tolerance: float) -> tuple[int, int]:
    """Return the longest run within first to last on a circle through three random points."""
    i = np.random.randint(first, last + 1)
    j = np.random.randint(first, last + 1)
    k = np.random.randint(first, last + 1)
    if i == j or j == k or k == i:
        return first, first - 1
    A, B, C = _circle(points[i], points[j], points[k])
    best, begin = (first, first - 1), first
    for at in range(first, last + 2):
        fits = at <= last
        if fits:
            x, y = points[at, 0] - points[j, 0], points[at, 1] - points[j, 1]
            p = A * (x * x + y * y) + B * x + C * y
            fits = 2 * abs(p) <= tolerance * (1 + math.sqrt(max(0.0, 1 + 4 * A * p)))
        if not fits:
            if at - begin > best[1] - best[0] + 1:
                best = begin, at - 1
            begin = at + 1
    return best


@numba.njit
def _longest(points: np.ndarray, first: int, last: int, tolerance: float) -> tuple[int, int]:
    best, tried, needed = (first, first - 1), 0, float(MOST)
    while tried < needed:
        tried += 1
        run = _run(points, first, last, tolerance)
        if run[1] - run[0] > best[1] - best[0]:
            best = run
            miss = 1 - ((best[1] - best[0] + 1) / (last - first + 1)) ** 3
            needed = min(MOST, math.log(ALL_MISS) / math.log(miss)) if miss > 0 else 0.0
    return best


@numba.njit
def search(points: np.ndarray, tolerance: float, shortest: float,
           seed: int) -> list[tuple[int, int]]:
    """Return the indices of the first and last point of every run on a chain (n, 2) px."""
    np.random.seed(seed)
    found, waiting = [(0, -1)], [(0, len(points) - 1)]
    while len(waiting):
        first, last = waiting.pop()
        if last - first + 1 < shortest:
            continue
        low, high = _longest(points, first, last, tolerance)
        if high - low + 1 >= shortest:
            found.append((low, high))
            waiting.append((first, low - 1))
            waiting.append((high + 1, last))
    return found[1:]
