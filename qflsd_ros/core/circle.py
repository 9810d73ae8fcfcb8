"""
The generalised circle of Section 2: lines and circles as one family, without a singularity.

Equation (4) of the paper, ``x^2 + y^2 + e x + f y + g = 0``, cannot hold a line, and its least
squares (8), which is the fit of Kasa, pulls what is nearly straight towards small radii.  Here

    P(x, y) = A (x^2 + y^2) + B x + C y + D = 0  with  B^2 + C^2 - 4 A D = 1   (Pratt, 1987)

stands for both: A = 0 is a line, and with this normalisation the gradient of P has length 1 all
along the curve.  Its curvature is 2 A, and the signed distance of a point is
``2 P / (1 + sqrt(1 + 4 A P))``.

Points are taken relative to an origin near the curve, which keeps the numbers small.
References: V. Pratt, Direct least-squares fitting of algebraic surfaces, SIGGRAPH 1987; A.
Al-Sharadqah and N. Chernov, Error analysis for circle fitting algorithms, EJS 2009.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined, summed

Circle = tuple[float, float, float, float]

# How a lens bends the pictures of straight edges: lambda in 1 / px^2, and its centre x and y, px.
Lens = tuple[float, float, float]
NO_LENS = 0.0, 0.0, 0.0


@inlined
def value(circle: Circle, x: float, y: float) -> float:
    """Return P(x, y): the signed distance, up to a relative error of A P."""
    return circle[0] * (x * x + y * y) + circle[1] * x + circle[2] * y + circle[3]


@inlined
def at_centre(lam: float, x: float, y: float, b: float, c: float, d: float) -> float:
    """
    Return P at the centre (x, y) of a lens, of the picture of a straight edge.

    It is given by its B, C and D; its A is lambda times what is returned (paper, equation (4)).
    """
    return (b * x + c * y + d) / (1 - lam * (x * x + y * y))


@inlined
def distance(circle: Circle, x: float, y: float) -> float:
    """Return the exact signed distance of a point from the circle, px."""
    p = value(circle, x, y)
    return 2 * p / (1 + math.sqrt(max(0.0, 1 + 4 * circle[0] * p)))


@inlined
def through(x0: float, y0: float, x1: float, y1: float, x2: float, y2: float,
            sharpest: float) -> tuple[Circle, float]:
    """
    Return the generalised circle through three points, and its gradient's squared length.

    It is not normalised, so that a hypothesis may be dropped before it has cost a root: see
    :func:`normalised`.  The points are given in px relative to any origin; the circle's origin is
    (x1, y1).  Where it would be bent more than ``sharpest`` (1/px), which the noise of close
    points brings about, it is the line through the outer two; where these coincide, all is 0.
    """
    ax, ay = x0 - x1, y0 - y1
    bx, by = x2 - x1, y2 - y1
    # D = 0 since the origin lies on it; A, B, C are the minors of the other two rows.
    a2, b2 = ax * ax + ay * ay, bx * bx + by * by
    A = ax * by - ay * bx
    B = ay * b2 - a2 * by
    C = a2 * bx - ax * b2
    square = B * B + C * C
    if 4 * A * A <= sharpest * sharpest * square and square > 0.0:
        return (A, B, C, 0.0), square
    ux, uy = bx - ax, by - ay
    return (0.0, -uy, ux, ax * uy - ay * ux), ux * ux + uy * uy


@inlined
def pictured(x0: float, y0: float, x1: float, y1: float, lam: float) -> tuple[Circle, float]:
    """
    Return the picture of the straight edge through two points, and its gradient's squared length.

    It is not normalised, as in :func:`through`.  The points are given in px relative to the centre
    of the lens, which is the circle's origin, and ``lam`` is lambda in 1/px^2: A = lambda D.
    """
    w0, w1 = 1 + lam * (x0 * x0 + y0 * y0), 1 + lam * (x1 * x1 + y1 * y1)
    B, C, D = y0 * w1 - y1 * w0, x1 * w0 - x0 * w1, x0 * y1 - x1 * y0
    return (lam * D, B, C, D), B * B + C * C - 4 * lam * D * D


@inlined
def normalised(circle: Circle, square: float) -> Circle:
    """Divide a circle by the length of its gradient, of which the square is given."""
    scale = 1 / math.sqrt(square)
    return circle[0] * scale, circle[1] * scale, circle[2] * scale, circle[3] * scale


# What a fit is: one row of a float64 array.  ``var_A`` is what decisions take for the variance of
# A; ``lever_A`` and ``lever_D`` are the variances of A and D for each px^2 of a point's variance;
# ``bent`` is 1 where A is fitted, 0 where it is that of the picture of a straight edge.
FIT = ('x', 'y', 'A', 'B', 'C', 'D', 'rss', 'n', 'var_A', 'lever_A', 'lever_D', 'bent')
FIT_SIZE = len(FIT)
NOISE_FLOOR = 0.05      # px, the least standard deviation that a point is believed to have
# Edge points in a row are located from pixels that they share, and blurred together: their errors
# agree over about this many, of which each but one tells nothing new (measured on rendered edges).
CORRELATED = 3.0


# Sums of z^2, z t, z, t^2, t, 1, z v, t v, v and v^2 over points (t, v), where z = t^2 + v^2.
Moments = tuple[float, float, float, float, float, float, float, float, float, float]


@summed
def _moments(points: np.ndarray, first: int, last: int, ox: float, oy: float, ux: float,
             uy: float) -> Moments:
    """Return the weighted moments of points in a frame with origin (ox, oy) and axis (ux, uy)."""
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


# A, B, D, the residual sum of squares, and lever_A and lever_D of :data:`FIT`.
Solution = tuple[float, float, float, float, float, float]


@inlined
def _circle(moments: Moments, residual: float) -> Solution:
    """Return the least squares of A z + B t + D + v; its levers are nan where there is none."""
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
def _straight(moments: Moments, residual: float, a: float, lever_a: float) -> Solution:
    """Return the least squares with a given A; its levers are nan where there is none."""
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


@compiled
def fit(points: np.ndarray, first: int, last: int, residual: float, significance: float,
        sharpest: float, lens: Lens, fits: np.ndarray, row: int) -> bool:
    """
    Fit the generalised circle to points ``first`` to ``last`` by least squares.

    In a frame with its origin at the middle point and its x axis along the chord, C is close to 1
    all along the arc, so that minimising sum w (A (x^2 + y^2) + B x + D + y)^2 minimises the
    distances, without the bias of equation (8).  The picture of a straight edge (A = 0 without a
    lens) is fitted instead where A does not differ from that by more than ``significance``
    standard deviations, or the curvature is above ``sharpest``, 1/px; a curve that would still be
    bent more than that is none.

    Parameters
    ----------
    points
        (2, N) x and y, px, or (3, N) with the number of edge points that each stands for.
    first, last
        Which of them to fit, both included.
    residual
        Residual sum of squares of those edge points about the given ones, px^2, to be added.
    significance, sharpest, lens
        See above.
    fits, row
        (R, FIT_SIZE) float64, of which the row takes what :data:`FIT` names: origin, A to D (in
        the image's axes, relative to the origin), residual sum of squares, sum of weights, and how
        certain A and D are.

    Returns
    -------
    False, and writes nothing, where the points do not determine a curve, or none that may be.

    """
    middle = (first + last) // 2
    ox, oy = float(points[0, middle]), float(points[1, middle])
    ux, uy = float(points[0, last] - points[0, first]), float(points[1, last] - points[1, first])
    size = math.sqrt(ux * ux + uy * uy)
    if size == 0.0:
        return False
    ux, uy = ux / size, uy / size
    moments = _moments(points, first, last, ox, oy, ux, uy)
    a, b, d, rss, lever_a, lever_d = _circle(moments, residual)
    var_a = lever_a * CORRELATED * max(rss / max(moments[5] - 3.0, 1.0), NOISE_FLOOR ** 2)
    cx, cy = lens[1] - ox, lens[2] - oy
    usual = lens[0] * at_centre(lens[0], cx * ux + cy * uy, cy * ux - cx * uy, b, 1.0, d)
    norm = math.sqrt(max(b * b + 1.0 - 4.0 * a * d, 1e-12))
    bent = (a - usual) ** 2 > significance ** 2 * var_a and 2 * abs(a) <= sharpest * norm
    if not bent:
        var_a, lever_a = (var_a, lever_a) if var_a >= 0 else (0.0, 0.0)
        a, b, d, rss, lever_a, lever_d = _straight(moments, residual, usual, lever_a)
        norm = math.sqrt(max(b * b + 1.0 - 4.0 * a * d, 1e-12))
        if not (lever_d >= 0 and 2 * abs(a) <= sharpest * norm):
            return False
    fits[row, 0], fits[row, 1], fits[row, 2] = ox, oy, a / norm
    fits[row, 3], fits[row, 4] = (b * ux - uy) / norm, (b * uy + ux) / norm
    fits[row, 5], fits[row, 6], fits[row, 7] = d / norm, rss, moments[5]
    fits[row, 8], fits[row, 9], fits[row, 10], fits[row, 11] = var_a, lever_a, lever_d, bent
    return True


@inlined
def foot(fits: np.ndarray, i: int, x: float, y: float) -> tuple[float, float, float, float]:
    """Return the point of fitted curve i closest to (x, y), and the unit tangent there."""
    dx, dy = x - fits[i, 0], y - fits[i, 1]
    d = distance((fits[i, 2], fits[i, 3], fits[i, 4], fits[i, 5]), dx, dy)
    gx, gy = 2 * fits[i, 2] * dx + fits[i, 3], 2 * fits[i, 2] * dy + fits[i, 4]
    size = math.sqrt(gx * gx + gy * gy)
    gx, gy = gx / size, gy / size
    return x - d * gx, y - d * gy, -gy, gx
