"""
The generalised circle of Section 2 of the paper: lines and circles as one family of curves.

Equation (4) of the paper, ``x^2 + y^2 + e x + f y + g = 0``, cannot express a line, and its least
squares (8), the fit of Kasa, biases nearly straight arcs towards small radii.  This module uses

    P(x, y) = A (x^2 + y^2) + B x + C y + D = 0  with  B^2 + C^2 - 4 A D = 1   (Pratt, 1987)

instead.  A line has A = 0.  With this normalisation the gradient of P has length 1 on the curve,
the curvature is 2 A, and the signed distance of a point is ``2 P / (1 + sqrt(1 + 4 A P))``.

Points are given relative to an origin near the curve, which keeps the numbers small.
References: V. Pratt, Direct least-squares fitting of algebraic surfaces, SIGGRAPH 1987; A.
Al-Sharadqah and N. Chernov, Error analysis for circle fitting algorithms, EJS 2009.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined, summed

Circle = tuple[float, float, float, float]      # A, B, C, D
Point = tuple[float, float]                     # x, y, px

# Columns of a fit, one row of a float64 array: the origin; A to D relative to it, along the
# image's axes; the residual sum of squares and the sum of the weights of the points; the variance
# of A by these residuals; the variances of A and D for points of a variance of 1 px^2; and 1 where
# A is fitted, 0 where it is that of the image of a line.
X0, Y0, A, B, C, D, RSS, COUNT, VAR_A, LEVER_A, LEVER_D, BENT, FIT_SIZE = range(13)

NOISE_FLOOR = 0.05      # px, least standard deviation of a point (tuned on rendered edges)
# Number of neighbouring edge points with the same error: they are located from shared pixels, and
# blurred together (measured on rendered edges).
CORRELATED = 3.0


class LensPrior(NamedTuple):
    """
    The lens as the kernels use it: a division model with the standard deviation of its lambda.

    An unknown lens is :data:`UNKNOWN_LENS`: its lambda is 0 with an infinite standard deviation.
    """

    lam: float      # lambda, 1/px^2
    x: float        # centre of the distortion, px
    y: float
    std: float      # standard deviation of lambda, 1/px^2


UNKNOWN_LENS = LensPrior(0.0, 0.0, 0.0, math.inf)


@inlined
def is_known(lens: LensPrior) -> bool:
    """Return whether a lens is known: its lambda has a finite standard deviation."""
    return lens.std < math.inf


class CurvatureLimits(NamedTuple):
    """The limits of the curvature of a fit."""

    significance: float     # standard deviations of A from the image of a line, to be bent
    maximum: float          # 1/px
    lens: LensPrior


@inlined
def value(circle: Circle, x: float, y: float) -> float:
    """Return P(x, y): the signed distance, up to a relative error of A P."""
    return circle[0] * (x * x + y * y) + circle[1] * x + circle[2] * y + circle[3]


@inlined
def at_centre(lam: float, x: float, y: float, b: float, c: float, d: float) -> float:
    """
    Return P at the centre (x, y) of a lens, for the image of a line with the given B, C and D.

    Equation (4) of the paper makes A the product of lambda and this value.
    """
    return (b * x + c * y + d) / (1 - lam * (x * x + y * y))


@inlined
def distance(circle: Circle, x: float, y: float) -> float:
    """Return the exact signed distance of a point from the circle, px."""
    p = value(circle, x, y)
    return 2 * p / (1 + math.sqrt(max(0.0, 1 + 4 * circle[0] * p)))


@inlined
def through(start: Point, middle: Point, end: Point,
            max_curvature: float) -> tuple[Circle, float]:
    """
    Return the generalised circle through three points, and its gradient's squared length.

    The circle is not normalised, see :func:`normalised`: a hypothesis that is rejected does not
    cost a square root.  The points are given in px relative to any origin; the circle's origin is
    the middle one.  If the curvature were above ``max_curvature``, 1/px, as the noise of close
    points causes, the circle is the line through the outer points.  If these coincide, all is 0.
    """
    ax, ay = start[0] - middle[0], start[1] - middle[1]
    bx, by = end[0] - middle[0], end[1] - middle[1]
    # D = 0 since the origin lies on it; A, B, C are the minors of the other two rows.
    a2, b2 = ax * ax + ay * ay, bx * bx + by * by
    a = ax * by - ay * bx
    b = ay * b2 - a2 * by
    c = a2 * bx - ax * b2
    square = b * b + c * c
    if 4 * a * a <= max_curvature * max_curvature * square and square > 0.0:
        return (a, b, c, 0.0), square
    ux, uy = bx - ax, by - ay
    return (0.0, -uy, ux, ax * uy - ay * ux), ux * ux + uy * uy


@inlined
def image_of_line(start: Point, end: Point, lam: float) -> tuple[Circle, float]:
    """
    Return the image of the line through two points, and its gradient's squared length.

    It is not normalised, as in :func:`through`.  The points are given in px relative to the centre
    of the lens, which is the circle's origin, and ``lam`` is lambda in 1/px^2: A = lambda D.
    """
    (x0, y0), (x1, y1) = start, end
    w0, w1 = 1 + lam * (x0 * x0 + y0 * y0), 1 + lam * (x1 * x1 + y1 * y1)
    b, c, d = y0 * w1 - y1 * w0, x1 * w0 - x0 * w1, x0 * y1 - x1 * y0
    return (lam * d, b, c, d), b * b + c * c - 4 * lam * d * d


@inlined
def normalised(circle: Circle, square: float) -> Circle:
    """Divide a circle by the length of its gradient, whose square is given."""
    scale = 1 / math.sqrt(square)
    return circle[0] * scale, circle[1] * scale, circle[2] * scale, circle[3] * scale


# Sums of z^2, z t, z, t^2, t, 1, z v, t v, v and v^2 over points (t, v), where z = t^2 + v^2.
Moments = tuple[float, float, float, float, float, float, float, float, float, float]
Frame = tuple[float, float, float, float]       # origin and unit x axis


@summed
def _moments(points: np.ndarray, first: int, last: int, frame: Frame) -> Moments:
    """Return the weighted moments of points first to last in a frame."""
    ox, oy, ux, uy = frame
    szz = szt = sz = stt = st = sw = szv = stv = sv = svv = 0.0
    weighted = len(points) == 3
    for i in range(first, last + 1):
        dx, dy = points[0, i] - ox, points[1, i] - oy
        t, v = dx * ux + dy * uy, dy * ux - dx * uy
        z = t * t + v * v
        w = float(points[2, i]) if weighted else 1.0
        szz += w * z * z
        szt += w * z * t
        sz += w * z
        stt += w * t * t
        st += w * t
        sw += w
        szv += w * z * v
        stv += w * t * v
        sv += w * v
        svv += w * v * v
    return szz, szt, sz, stt, st, sw, szv, stv, sv, svv


# A, B, D, the residual sum of squares, and the variances LEVER_A and LEVER_D.
Solution = tuple[float, float, float, float, float, float]


@inlined
def _circle(moments: Moments, residual: float) -> Solution:
    """Return the least squares of A z + B t + D + v; both variances are nan if singular."""
    szz, szt, sz, stt, st, sw, szv, stv, sv, svv = moments
    # The inverse of the symmetric matrix of the normal equations, by its cofactors.
    caa, cab, cad = stt * sw - st * st, sz * st - szt * sw, szt * st - sz * stt
    cbb, cbd, cdd = szz * sw - sz * sz, szt * sz - szz * st, szz * stt - szt * szt
    det = szz * caa + szt * cab + sz * cad
    if not det > 1e-12 * szz * stt * sw:
        return 0.0, 0.0, 0.0, 0.0, np.nan, np.nan
    a = -(caa * szv + cab * stv + cad * sv) / det
    b = -(cab * szv + cbb * stv + cbd * sv) / det
    d = -(cad * szv + cbd * stv + cdd * sv) / det
    rss = residual + max(0.0, svv + a * szv + b * stv + d * sv)
    return a, b, d, rss, caa / det, cdd / det


@inlined
def _of_curvature(moments: Moments, residual: float, a: float, lever_a: float) -> Solution:
    """Return the least squares for a given A; LEVER_D is nan if singular."""
    szz, szt, sz, stt, st, sw, szv, stv, sv, svv = moments
    det = stt * sw - st * st
    if not det > 0.0:
        return 0.0, 0.0, 0.0, 0.0, np.nan, np.nan
    # Of a z + v instead of v.
    stv, sv, svv = stv + a * szt, sv + a * sz, svv + a * (2 * szv + a * szz)
    b = -(sw * stv - st * sv) / det
    d = -(stt * sv - st * stv) / det
    rss = residual + max(0.0, svv + b * stv + d * sv)
    return a, b, d, rss, lever_a, stt / det


@inlined
def _line_curvature(lens: LensPrior, frame: Frame, b: float, d: float) -> float:
    """Return the A that the image of a line has through a lens, given its B and D in a frame."""
    ox, oy, ux, uy = frame
    cx, cy = lens.x - ox, lens.y - oy
    return lens.lam * at_centre(lens.lam, cx * ux + cy * uy, cy * ux - cx * uy, b, 1.0, d)


@inlined
def _norm(a: float, b: float, d: float) -> float:
    """Return the length of the gradient of a circle with C = 1."""
    return math.sqrt(max(b * b + 1.0 - 4.0 * a * d, 1e-12))


@compiled
def fit(points: np.ndarray, span: tuple[int, int], residual: float, limits: CurvatureLimits,
        fits: np.ndarray, row: int) -> bool:
    """
    Fit the generalised circle to a span of points by least squares.

    In a frame with its origin at the middle point and its x axis along the chord, C is close to 1
    all along the arc.  Minimising sum w (A (x^2 + y^2) + B x + D + y)^2 therefore minimises the
    distances, without the bias of equation (8).  The image of a line (A = 0 without a lens) is
    fitted instead where A does not differ significantly from its A, or the curvature is above the
    maximum.

    Parameters
    ----------
    points
        (2, N) x and y, px, or (3, N) with the number of edge points that each represents.
    span
        First and last point to fit, both included.
    residual
        Residual sum of squares of the represented edge points about the given points, px^2.
    limits
        Significance and maximum of the curvature, and the lens.
    fits, row
        (R, FIT_SIZE) float64, and the row of it that receives the fit.

    Returns
    -------
    Whether there is a fit.  There is none, and nothing is written, if the points do not determine
    a curve, or the image of a line would exceed the maximum curvature.

    """
    first, last = span
    middle = (first + last) // 2
    ox, oy = float(points[0, middle]), float(points[1, middle])
    ux, uy = float(points[0, last] - points[0, first]), float(points[1, last] - points[1, first])
    size = math.sqrt(ux * ux + uy * uy)
    if size == 0.0:
        return False
    ux, uy = ux / size, uy / size
    frame = (ox, oy, ux, uy)
    moments = _moments(points, first, last, frame)
    count = moments[5]
    a, b, d, rss, lever_a, lever_d = _circle(moments, residual)
    var_a = lever_a * CORRELATED * max(rss / max(count - 3.0, 1.0), NOISE_FLOOR ** 2)
    line_a = _line_curvature(limits.lens, frame, b, d)
    norm = _norm(a, b, d)
    bent = ((a - line_a) ** 2 > limits.significance ** 2 * var_a
            and 2 * abs(a) <= limits.maximum * norm)
    if not bent:
        var_a, lever_a = (var_a, lever_a) if var_a >= 0 else (0.0, 0.0)
        a, b, d, rss, lever_a, lever_d = _of_curvature(moments, residual, line_a, lever_a)
        norm = _norm(a, b, d)
        if not (lever_d >= 0 and 2 * abs(a) <= limits.maximum * norm):
            return False
    fits[row, X0], fits[row, Y0], fits[row, A] = ox, oy, a / norm
    fits[row, B], fits[row, C] = (b * ux - uy) / norm, (b * uy + ux) / norm
    fits[row, D], fits[row, RSS], fits[row, COUNT] = d / norm, rss, count
    fits[row, VAR_A], fits[row, LEVER_A], fits[row, LEVER_D] = var_a, lever_a, lever_d
    fits[row, BENT] = bent
    return True


@inlined
def curve(fits: np.ndarray, i: int) -> Circle:
    """Return A to D of fit i, relative to its origin."""
    return fits[i, A], fits[i, B], fits[i, C], fits[i, D]


@inlined
def value_at(fits: np.ndarray, i: int, x: float, y: float) -> float:
    """Return P of fit i at a point of the image: close to the curve the distance, px."""
    return value(curve(fits, i), x - fits[i, X0], y - fits[i, Y0])


@inlined
def normal_at(fits: np.ndarray, i: int, x: float, y: float) -> tuple[float, float]:
    """Return the gradient of P of fit i at a point of the image: a unit normal on the curve."""
    return (2 * fits[i, A] * (x - fits[i, X0]) + fits[i, B],
            2 * fits[i, A] * (y - fits[i, Y0]) + fits[i, C])


@inlined
def foot(fits: np.ndarray, i: int, x: float, y: float) -> tuple[float, float, float, float]:
    """Return the point of fit i closest to (x, y), and the unit tangent there."""
    d = distance(curve(fits, i), x - fits[i, X0], y - fits[i, Y0])
    gx, gy = normal_at(fits, i, x, y)
    size = math.sqrt(gx * gx + gy * gy)
    gx, gy = gx / size, gy / size
    return x - d * gx, y - d * gy, -gy, gx


@inlined
def arc_between(fits: np.ndarray, i: int, x0: float, y0: float, x1: float,
                y1: float) -> tuple[float, float, float, float]:
    """
    Return middle x and y, curvature and length of the arc between two points of fit i.

    Units are px and 1/px.  The curvature is positive where travel from (x0, y0) to (x1, y1) turns
    from the x axis to the y axis.
    """
    cx, cy, mx, my = x1 - x0, y1 - y0, (x0 + x1) / 2, (y0 + y1) / 2
    chord = math.sqrt(cx * cx + cy * cy)
    gx, gy = normal_at(fits, i, mx, my)
    # The curve bends towards -A times its gradient; travel turns positively if that lies to the
    # side of the normal (-cy, cx).
    bend = 2 * abs(fits[i, A])
    turn = 1.0 if fits[i, A] * (gy * cx - gx * cy) < 0 else -1.0
    half = math.asin(min(1.0, bend * chord / 2))
    sagitta = turn * chord / 2 * math.tan(half / 2)
    curvature = turn * bend if bend > 0 else 0.0
    length = 2 * half / bend if half > 1e-9 else chord
    return mx + sagitta * cy / chord, my - sagitta * cx / chord, curvature, length
