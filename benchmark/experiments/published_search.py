"""
Algorithms 1 and 2 of the paper as in :mod:`qflsd_ros.core.paper`, compiled for long searches.

The random triples are others, everything else is the same: the algebraic error of equation (10),
the bound on the number of hypotheses by (12), and the remainders of a contour.
"""
from __future__ import annotations

import math

import numba
import numpy as np
from qflsd_ros.core import Parameters
from qflsd_ros.core.paper import DRAWS

SEED = 0


@numba.njit
def _circle(points: np.ndarray, first: int, last: int) -> tuple[float, float, float, bool]:
    """Return centre and squared radius of a circle through random points, and if there is one."""
    for _ in range(DRAWS):
        a, b = np.random.randint(first, last), np.random.randint(first, last)
        c = np.random.randint(first, last)
        bx, by = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
        cx, cy = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1]
        area = 2 * (bx * cy - by * cx)
        if area != 0:
            b2, c2 = bx * bx + by * by, cx * cx + cy * cy
            x, y = (cy * b2 - by * c2) / area, (bx * c2 - cx * b2) / area
            return points[a, 0] + x, points[a, 1] + y, x * x + y * y, True
    return 0.0, 0.0, 0.0, False


@numba.njit
def _longest(points: np.ndarray, first: int, last: int, epsilon: float, confidence: float,
             most: int) -> tuple[int, int]:
    """Return the longest run within first to last - 1 whose |E| is epsilon at most."""
    best, tried, needed = (first, first), 0, float(most)
    while tried < needed:
        tried += 1
        x, y, squared, is_circle = _circle(points, first, last)
        if not is_circle:
            break
        begin = first
        for at in range(first, last + 1):
            if at < last and abs((points[at, 0] - x) ** 2 + (points[at, 1] - y) ** 2
                                 - squared) <= epsilon:
                continue
            if at - begin > best[1] - best[0]:
                best = begin, at
                miss = 1 - ((at - begin) / (last - first)) ** 3
                needed = min(float(most), math.ceil(math.log(1 - confidence) / math.log(miss))
                             if miss > 0 else 1.0)
            begin = at + 1
    return best


@numba.njit
def _search(points: np.ndarray, epsilon: float, confidence: float, most: int,
            shortest: float, seed: int) -> list[tuple[int, int]]:
    """Return first and last + 1 of all segments of a contour (n, 2) px."""
    np.random.seed(seed)
    found, waiting = [(0, 0)], [(0, len(points))]
    while len(waiting):
        first, last = waiting.pop()
        if last - first < shortest:
            continue
        low, high = _longest(points, first, last, epsilon, confidence, most)
        if high - low >= shortest:
            found.append((low, high))
            waiting.append((first, low))
            waiting.append((high, last))
    return found[1:]


def segments(contour: np.ndarray, parameters: Parameters, _: object) -> list[np.ndarray]:
    """Return all edge segments of a contour (n, 2) px, as :func:`paper.segments`."""
    runs = _search(contour, parameters.paper_epsilon, parameters.paper_confidence,
                   parameters.paper_max_hypotheses, parameters.min_length, SEED)
    return [contour[first:last] for first, last in runs]
