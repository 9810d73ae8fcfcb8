"""
QF-LSD exactly as published: Algorithms 1 to 3 in plain numpy.

The reference for tests and comparisons (``method: paper``).  What the paper leaves open is marked
"open:" below with what was chosen.  Its weaknesses are kept: contours that run out and back along
an open edge, an algebraic error whose meaning changes with the radius, and the fit of Kasa.

Reference: Qiao, Xu, Wang, Cheng, Dong, Quadratic Curve Fitting-Based Image Edge Line Segment
Detection, Appl. Sci. 2023, 13(15), 8654.
"""
from __future__ import annotations

import math

import cv2
import numpy as np

from qflsd_ros.core.arcs import Arcs, TABLE
from qflsd_ros.core.parameters import Parameters

# All of these are chosen, not tuned, unless stated otherwise.
DRAWS = 20          # open: attempts at three points that are not collinear
SOBEL_GAIN = 4.0    # response of cv2.Canny's Sobel filter to a step of one grey level


def solve(points: np.ndarray) -> np.ndarray | None:
    """
    Return (e, f, g) of equation (5) by the normal equations (8) and (9).

    ``points`` is (n, 2) float64, n >= 3; None where they are collinear.
    """
    x, y = points[:, 0], points[:, 1]
    design = np.column_stack([x, y, np.ones(len(points))])
    left, right = design.T @ design, -design.T @ (x * x + y * y)
    if abs(np.linalg.det(left)) < 1e-6:
        return None
    return np.linalg.solve(left, right)


def error(points: np.ndarray, model: np.ndarray) -> np.ndarray:
    """Return E of equation (10) for (n, 2) points: (n,) px^2."""
    x, y = points[:, 0], points[:, 1]
    e, f, g = model
    return x * x + y * y + e * x + f * y + g


def longest_run(fits: np.ndarray) -> tuple[int, int]:
    """Return [n1, n2) of the longest run of True in a (n,) bool array; (0, 0) if there is none."""
    padded = np.concatenate([[0], fits.astype(np.int8), [0]])
    steps = np.diff(padded)
    begins, ends = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
    if not len(begins):
        return 0, 0
    k = int(np.argmax(ends - begins))
    return int(begins[k]), int(ends[k])


def hypothesis(points: np.ndarray, random: np.random.Generator) -> np.ndarray | None:
    """Draw three non-collinear points at random and return their (e, f, g) (Step 2)."""
    for _ in range(DRAWS):
        model = solve(points[random.choice(len(points), 3, replace=False)])
        if model is not None:
            return model
    return None


def repetitions(length: int, n: int, confidence: float) -> int:
    """Return K of equation (12) for a run of ``length`` of ``n`` pixels, with P of (11)."""
    p = 1 - (length / n) ** 3
    if p <= 0:
        return 1
    return math.ceil(math.log(1 - confidence) / math.log(p)) if p < 1 else 2 ** 62


def longest_segment(contour: np.ndarray, parameters: Parameters,
                    random: np.random.Generator) -> tuple[int, int]:
    """
    Return [n1, n2) of the longest continuous run of a contour on one curve (Algorithm 1).

    K follows the longest run found so far, as the paper's text has it; open: it is bounded by
    ``paper_max_hypotheses``, without which a contour that holds no segment would never end.
    """
    best, k, needed = (0, 0), 0, parameters.paper_max_hypotheses
    while k < needed:
        k += 1
        model = hypothesis(contour, random)
        if model is None:
            break
        run = longest_run(np.abs(error(contour, model)) <= parameters.paper_epsilon)
        if run[1] - run[0] > best[1] - best[0]:
            best = run
            needed = min(parameters.paper_max_hypotheses,
                         repetitions(best[1] - best[0], len(contour), parameters.paper_confidence))
    return best


def remove(contour: np.ndarray, run: tuple[int, int]) -> list[np.ndarray]:
    """Return what remains of a contour without a run: the cases of Figure 2 (Algorithm 2)."""
    return [piece for piece in (contour[:run[0]], contour[run[1]:]) if len(piece)]


def segments(contour: np.ndarray, parameters: Parameters,
             random: np.random.Generator) -> list[np.ndarray]:
    """Return all edge segments of one contour, each (n, 2) float64 (Steps 2 to 5)."""
    found, remaining = [], [contour]
    while remaining:
        piece = remaining.pop()
        if len(piece) < parameters.min_length:
            continue
        run = longest_segment(piece, parameters, random)
        if run[1] - run[0] < parameters.min_length:
            continue
        found.append(piece[run[0]:run[1]])
        remaining += remove(piece, run)
    return found


def contours(gray: np.ndarray, parameters: Parameters) -> list[np.ndarray]:
    """
    Return the contours of Step 1, each (n, 2) float64, by Canny and Moore-neighbour tracing.

    Open: "the image size" of the 1/20 is taken for the mean of width and height.
    """
    if parameters.blur_sigma > 0:
        gray = cv2.GaussianBlur(gray, (0, 0), parameters.blur_sigma)
    low, high = parameters.contrast_low, parameters.contrast_high
    edge_map = cv2.Canny(gray, SOBEL_GAIN * low, SOBEL_GAIN * high, L2gradient=True)
    found, _ = cv2.findContours(edge_map, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    shortest = parameters.paper_min_contour * sum(gray.shape) / 2
    return [c.reshape(-1, 2).astype(float) for c in found if len(c) >= shortest]


def detect(gray: np.ndarray, parameters: Parameters) -> Arcs:
    """Find the edge segments of a (H, W) uint8 image (Algorithm 3)."""
    random = np.random.default_rng(parameters.paper_seed)
    found = [piece for contour in contours(gray, parameters)
             for piece in segments(contour, parameters, random)]
    if not found:
        return Arcs.empty()
    table = np.zeros(len(found), TABLE)
    for row, piece in zip(table, found):
        describe(row, piece)
    points = np.concatenate(found)
    offsets = np.cumsum([0] + [len(piece) for piece in found])
    return Arcs(table, points, points.astype(np.int32), offsets)


def describe(row: np.void, piece: np.ndarray) -> None:
    """
    Fill a row of the table from the pixels of one segment.

    Open: the paper reports pixels; here the circle goes through the two farthest apart, between
    which a contour may run out and back, and one halfway between them, since the fit of equation
    (8) turns straight segments into small circles.
    """
    start = piece[np.argmax(_distances(piece, piece[0]))]
    end = piece[np.argmax(_distances(piece, start))]
    middle = piece[np.argmin(np.abs(_distances(piece, start) - _distances(piece, end)))]
    a, b, chord = middle - start, end - middle, end - start
    cross = a[0] * b[1] - a[1] * b[0]
    sizes = [max(float(np.hypot(*v)), 1e-9) for v in (a, b, chord)]
    curvature = 2 * cross / math.prod(sizes)
    half = math.asin(min(1.0, abs(curvature) * sizes[2] / 2))
    length = 2 * half / abs(curvature) if half > 1e-9 else sizes[2]
    normal = np.array([-chord[1], chord[0]]) / sizes[2]
    sagitta = math.copysign(sizes[2] / 2 * math.tan(half / 2), curvature)
    row['start'], row['end'] = start, end
    row['middle'] = (start + end) / 2 - sagitta * normal
    row['curvature'], row['length'], row['support'] = curvature, length, len(piece)
    row['rms'] = _rms(piece, row['middle'], chord / sizes[2], curvature)


def _distances(piece: np.ndarray, point: np.ndarray) -> np.ndarray:
    return np.hypot(piece[:, 0] - point[0], piece[:, 1] - point[1])


def _rms(piece: np.ndarray, origin: np.ndarray, along: np.ndarray, curvature: float) -> float:
    """Root mean square of the distances from the circle through ``origin`` with that tangent."""
    q = piece - origin
    p = (q[:, 1] * along[0] - q[:, 0] * along[1]) - curvature / 2 * (q ** 2).sum(axis=1)
    d = 2 * p / (1 + np.sqrt(np.maximum(0, 1 - 2 * curvature * p)))
    return float(np.sqrt(np.mean(d ** 2)))
