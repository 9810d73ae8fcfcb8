"""
Lines in space from the planes of one track in several posed views.

A view and its residual are those of :mod:`geometry.views`.  Two views determine the four degrees
of freedom of a line.

The estimate begins with the line in which two planes intersect, the pair among all views whose
line agrees with most of them.  Gauss-Newton steps with Student's weights follow, and least squares
over the views that agree.  A view counts as a whole or not at all.  Where all planes coincide, as
they do for a line along the camera's motion and for a camera that only turns, the line is not
determined, and flagged.

Reference: A. Bartoli and P. Sturm, Structure-from-motion using lines, CVIU 100(3), 2005, for the
residual of a line and four local parameters.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.cholesky import factorise, solve
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.geometry.lines import Lines
from qflsd_ros.core.geometry.views import (
    ACROSS, CENTRE, cross, dot, END, EXPECTED, Line, moment, NORMAL, place, square, START, TINY,
    TURN, Vector, VIEW)

# Columns of a result: point, direction, two directions across, first and last position along the
# line from the point, covariance, squared parallax, mean distance from the views, misfit, and
# number of views that agree.
(POINT, DIRECTION, SIDE, FIRST, LAST, COVARIANCE, PARALLAX, DISTANCE, MISFIT, AGREED,
 RESULT) = 0, 3, 6, 12, 13, 14, 30, 31, 32, 33, 34
UNKNOWNS = 4        # of a line: two shifts across and two tilts
# Degrees of freedom of Student's distribution of a residual: heavy tails, as for most robust fits.
NU = 4.0
STEPS = 6           # Gauss-Newton steps; the change is below rounding after 3 to 5
# Squared residual up to which a view agrees, in units of the views' own scale: the 99.9 % quantile
# of chi^2 with 2 degrees of freedom.
AGREES = 13.8
# Median of chi^2 with 2 degrees of freedom, by which a scale follows from a median.
MEDIAN = 2 * math.log(2)
# Largest scale of squared residuals: deviations 6 times as large as stated.  Normals of tracks
# deviate 1.5 times as much in the rendered room.  Without a limit, views that agree with nothing
# would agree with each other.
MAX_SCALE = 36.0
# Least share of views that agree; with half of them or fewer, another line would do as well.
SHARE = 0.5
PAIRS = 40          # pairs that are tried at most; outliers in every third view leave 4 in 9 pure
# Share of the views in which the edge may begin before the line does, or end after it.  Chosen,
# not tuned: .1 and .35 change distances from true edges by 5 %.
BEYOND = 0.25


class Memory(NamedTuple):
    """Memory of the kernels for K views of a line."""

    # (4, 4) by two shifts across and two tilts, the lower half; then its factor
    hessian: np.ndarray
    slope: np.ndarray       # (4,)
    squares: np.ndarray     # (K,) squared residuals
    ordered: np.ndarray     # (K,)
    weights: np.ndarray     # (K,)


def triangulate(views: np.ndarray, counts: np.ndarray) -> Lines:
    """
    Return the lines that tracks show in several views each.

    Parameters
    ----------
    views
        (N, K, VIEW) float64 of :func:`views.observed`, K views of N tracks.
    counts
        (N,) int64, how many of the K views of each track are there.

    Returns
    -------
    lines
        N lines.  Those with fewer than two views, those with views that contradict each other, and
        those whose planes coincide are not ``determined``.

    """
    return as_lines(results(views, counts))


def results(views: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return the lines of :func:`triangulate` as rows, (N, RESULT), for :func:`as_lines`."""
    rows = np.empty((len(views), RESULT))
    memory = Memory(np.empty((UNKNOWNS, UNKNOWNS)), np.empty(UNKNOWNS),
                    *(np.empty(views.shape[1]) for _ in range(3)))
    _triangulate(views, counts, rows, memory)
    return rows


def as_lines(rows: np.ndarray) -> Lines:
    """Return rows of RESULT columns as lines."""
    return Lines(
        rows[:, POINT:DIRECTION], rows[:, DIRECTION:SIDE], rows[:, SIDE:FIRST].reshape(-1, 2, 3),
        rows[:, FIRST:COVARIANCE], rows[:, COVARIANCE:PARALLAX].reshape(-1, 4, 4),
        np.sqrt(rows[:, PARALLAX]), rows[:, DISTANCE], rows[:, MISFIT],
        rows[:, AGREED].astype(np.int64))


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    triangulate(np.zeros((1, 2, VIEW)), np.zeros(1, np.int64))


@inlined
def _intersection(one: np.ndarray, two: np.ndarray) -> Line:
    """
    Return the line in which the planes of two views intersect.

    Its point is c + a n1 + b n2 with c halfway between the optical centres; all is 0 where the
    planes are parallel.
    """
    ax, ay, az = one[NORMAL], one[NORMAL + 1], one[NORMAL + 2]
    bx, by, bz = two[NORMAL], two[NORMAL + 1], two[NORMAL + 2]
    dx, dy, dz = cross(ax, ay, az, bx, by, bz)
    size_2, cosine = dx * dx + dy * dy + dz * dz, ax * bx + ay * by + az * bz
    if size_2 == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    hx, hy, hz = ((two[CENTRE] - one[CENTRE]) / 2, (two[CENTRE + 1] - one[CENTRE + 1]) / 2,
                  (two[CENTRE + 2] - one[CENTRE + 2]) / 2)
    u, v = -(ax * hx + ay * hy + az * hz), bx * hx + by * hy + bz * hz
    a, b = (u - cosine * v) / size_2, (v - cosine * u) / size_2
    px, py, pz = (one[CENTRE] + hx + a * ax + b * bx, one[CENTRE + 1] + hy + a * ay + b * by,
                  one[CENTRE + 2] + hz + a * az + b * bz)
    size = math.sqrt(size_2)
    line = px, py, pz, dx / size, dy / size, dz / size
    m, _ = moment(one, line)
    if dot(one, NORMAL, m) < 0:
        return px, py, pz, -line[3], -line[4], -line[5]
    return line


@compiled
def _begin(views: np.ndarray, count: int) -> Line:
    """Return the intersection of two planes that agrees with most views."""
    best, least = _intersection(views[0], views[count - 1]), math.inf
    apart = max(count // 3, 1)
    pairs = (count - apart) * (count - apart + 1) // 2
    stride, number = max(1, (pairs + PAIRS - 1) // PAIRS), 0
    for i in range(count - apart):
        for j in range(i + apart, count):
            number += 1
            if number % stride:
                continue
            line = _intersection(views[i], views[j])
            total = 0.0
            for k in range(count):
                total += min(square(views[k], line), AGREES * MAX_SCALE)
            if total < least:
                best, least = line, total
    return best


@inlined
def _sides(line: Line) -> tuple[Vector, Vector]:
    """Return two unit vectors across a line; the first has no part along the least axis."""
    x, y, z = abs(line[3]), abs(line[4]), abs(line[5])
    if x <= y and x <= z:
        a = 0.0, line[5], -line[4]
    elif y <= z:
        a = -line[5], 0.0, line[3]
    else:
        a = line[4], -line[3], 0.0
    size = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]) + TINY
    a = a[0] / size, a[1] / size, a[2] / size
    return a, cross(line[3], line[4], line[5], a[0], a[1], a[2])


@inlined
def _derivative(view: np.ndarray, column: int, m: Vector, size: float, change: Vector) -> float:
    """Return the derivative of a residual for a change of w."""
    along = m[0] * change[0] + m[1] * change[1] + m[2] * change[2]
    return (dot(view, column, change) - dot(view, column, m) * along) / size


@compiled
def _add(view: np.ndarray, line: Line, weight: float, memory: Memory) -> None:
    """Add a view to the lower half of the Hessian and to the slope."""
    a, b = _sides(line)
    m, size = moment(view, line)
    qx, qy, qz = line[0] - view[CENTRE], line[1] - view[CENTRE + 1], line[2] - view[CENTRE + 2]
    shift_a = cross(a[0], a[1], a[2], line[3], line[4], line[5])
    shift_b = cross(b[0], b[1], b[2], line[3], line[4], line[5])
    tilt_a = cross(qx, qy, qz, a[0], a[1], a[2])
    tilt_b = cross(qx, qy, qz, b[0], b[1], b[2])
    for column in (ACROSS, TURN):
        off = dot(view, column, m)
        j = (_derivative(view, column, m, size, shift_a),
             _derivative(view, column, m, size, shift_b),
             _derivative(view, column, m, size, tilt_a),
             _derivative(view, column, m, size, tilt_b))
        for r in range(UNKNOWNS):
            memory.slope[r] += weight * off * j[r]
            for c in range(r, UNKNOWNS):
                memory.hessian[c, r] += weight * j[r] * j[c]


@compiled
def _step(views: np.ndarray, count: int, line: Line, memory: Memory) -> tuple[Line, bool]:
    """Return the line after a Gauss-Newton step with the weights in the memory."""
    memory.hessian[:], memory.slope[:] = 0.0, 0.0
    for k in range(count):
        if memory.weights[k] > 0:
            _add(views[k], line, memory.weights[k], memory)
    if not factorise(memory.hessian, UNKNOWNS):
        return line, False
    solve(memory.hessian, memory.slope, UNKNOWNS)
    a, b = _sides(line)
    x, y, u, v = memory.slope[0], memory.slope[1], memory.slope[2], memory.slope[3]
    dx, dy, dz = (line[3] - u * a[0] - v * b[0], line[4] - u * a[1] - v * b[1],
                  line[5] - u * a[2] - v * b[2])
    size = math.sqrt(dx * dx + dy * dy + dz * dz)
    return (line[0] - x * a[0] - y * b[0], line[1] - x * a[1] - y * b[1],
            line[2] - x * a[2] - y * b[2], dx / size, dy / size, dz / size), True


@compiled
def _median(memory: Memory, count: int) -> float:
    """Return the median of the squared residuals, the higher one of two."""
    for k in range(count):
        _insert(memory.ordered, k, memory.squares[k])
    return memory.ordered[count // 2]


@inlined
def _insert(ordered: np.ndarray, count: int, value: float) -> None:
    """Insert a value into the first ``count`` ascending ones."""
    k = count
    while k > 0 and ordered[k - 1] > value:
        ordered[k] = ordered[k - 1]
        k -= 1
    ordered[k] = value


@compiled
def _scale(views: np.ndarray, count: int, line: Line, memory: Memory) -> float:
    """Set the squared residuals; return by how much they exceed what is stated, from 1 on."""
    for k in range(count):
        memory.squares[k] = square(views[k], line)
    return min(max(_median(memory, count) / MEDIAN, 1.0), MAX_SCALE)


@compiled
def _centred(views: np.ndarray, count: int, line: Line, memory: Memory) -> tuple[Line, int]:
    """
    Return the line with its point amid the views' arcs, and the number of weighted views.

    Views in which the arc is not in front of the camera lose their weight.
    """
    total, agreed = 0.0, 0
    for k in range(count):
        if memory.weights[k] > 0:
            view = views[k]
            ray = view[START] + view[END], view[START + 1] + view[END + 1], \
                view[START + 2] + view[END + 2]
            t, depth = place(view, line, ray)
            if depth > 0:
                total += t
                agreed += 1
            else:
                memory.weights[k] = 0.0
    t = total / max(agreed, 1)
    return (line[0] + t * line[3], line[1] + t * line[4], line[2] + t * line[5],
            line[3], line[4], line[5]), agreed


@compiled
def _fit(views: np.ndarray, count: int, line: Line, memory: Memory) -> tuple[Line, int]:
    """Return the line that fits most views, and how many; their weights are 1, others' 0."""
    for k in range(count):
        memory.weights[k] = 1.0
    line, _ = _centred(views, count, line, memory)
    for _ in range(STEPS):
        scale = _scale(views, count, line, memory)
        for k in range(count):
            memory.weights[k] = (NU + 2) / (NU + memory.squares[k] / scale)
        line, sound = _step(views, count, line, memory)
        if not sound:
            return line, 0
    scale = _scale(views, count, line, memory)
    for k in range(count):
        memory.weights[k] = 1.0 if memory.squares[k] <= AGREES * scale else 0.0
    line, agreed = _centred(views, count, line, memory)
    for _ in range(2):
        line, sound = _step(views, count, line, memory)
        if not sound:
            return line, 0
    return line, agreed


@compiled
def _parallax(views: np.ndarray, count: int, memory: Memory) -> float:
    """
    Return the sum of the squared residuals of the best plane that all views could share.

    A line at infinity, a line along the motion and a camera that only turns have 0.  It is the
    squared ratio of the line's parallax and its deviation.
    """
    x, y, z, total = 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        if memory.weights[k] > 0:
            x, y, z = x + views[k, NORMAL], y + views[k, NORMAL + 1], z + views[k, NORMAL + 2]
    size = math.sqrt(x * x + y * y + z * z) + TINY
    m = x / size, y / size, z / size
    for k in range(count):
        if memory.weights[k] > 0:
            a, b = dot(views[k], ACROSS, m), dot(views[k], TURN, m)
            total += a * a + b * b
    return total


@compiled
def _reach(views: np.ndarray, count: int, line: Line, memory: Memory) -> tuple[float, float]:
    """Return between which positions along the line all but a share of the views saw it."""
    first, last = 0.0, 0.0
    for column, sign in ((START, 1.0), (END, -1.0)):
        seen = 0
        for k in range(count):
            if memory.weights[k] > 0:
                ray = views[k, column], views[k, column + 1], views[k, column + 2]
                t, depth = place(views[k], line, ray)
                if depth > 0:
                    _insert(memory.ordered, seen, sign * t)
                    seen += 1
        t = sign * memory.ordered[min(int(BEYOND * seen) + 1, seen - 1)] if seen else 0.0
        first, last = (t, last) if sign > 0 else (first, t)
    return first, max(first, last)


@compiled
def _report(views: np.ndarray, count: int, line: Line, result: np.ndarray, memory: Memory) -> None:
    """Write a line, its deviations and its ends to a row."""
    result[FIRST], result[LAST] = _reach(views, count, line, memory)
    memory.hessian[:] = 0.0
    total, expected, distance, agreed = 0.0, 0.0, 0.0, 0
    for k in range(count):
        if memory.weights[k] > 0:
            _add(views[k], line, 1.0, memory)
            total += square(views[k], line)
            expected += views[k, EXPECTED]
            distance += math.sqrt((views[k, CENTRE] - line[0]) ** 2
                                  + (views[k, CENTRE + 1] - line[1]) ** 2
                                  + (views[k, CENTRE + 2] - line[2]) ** 2)
            agreed += 1
    # Two views leave no residual, from which a scale could be estimated.
    dof = max(2 * agreed - 4, 1)
    scale = max(total / (dof * expected / (2 * agreed)), 1.0)
    result[PARALLAX], result[AGREED] = _parallax(views, count, memory) / scale, agreed
    result[DISTANCE], result[MISFIT] = distance / agreed, math.sqrt(total / dof)
    if not factorise(memory.hessian, UNKNOWNS):
        result[PARALLAX] = 0.0
        return
    for c in range(UNKNOWNS):
        memory.slope[:] = 0.0
        memory.slope[c] = scale
        solve(memory.hessian, memory.slope, UNKNOWNS)
        for r in range(UNKNOWNS):
            result[COVARIANCE + UNKNOWNS * r + c] = memory.slope[r]
    a, b = _sides(line)
    for k in range(3):
        result[POINT + k], result[DIRECTION + k] = line[k], line[3 + k]
        result[SIDE + k], result[SIDE + 3 + k] = a[k], b[k]


@compiled
def _triangulate(views: np.ndarray, counts: np.ndarray, rows: np.ndarray, memory: Memory) -> None:
    """Fill in the rows, (N, RESULT)."""
    for i in range(len(views)):
        rows[i] = 0.0
        count = counts[i]
        if count < 2:
            continue
        line, agreed = _fit(views[i], count, _begin(views[i], count), memory)
        if agreed >= 2 and agreed > SHARE * count:
            _report(views[i], count, line, rows[i], memory)
