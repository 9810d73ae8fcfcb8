"""
The great circles that arcs and the optical centre span, and how far arcs point past a direction.

Coordinates are taken from the distortion centre, in half diagonals.  A point p = (x, y) of the
image is q(p) = (x, y, w) in the undistorted one, in homogeneous coordinates, with

    w(r) = 1 + lambda r^2 + mu r^2 (r^2 - KNOT),  r = |p|.

Lambda is that of the division model; mu is its error, as real fisheyes leave it: a stereographic
lens has mu = 0, an equidistant one about -lambda^2 / 5.  At r^2 = KNOT, about the radius of the
arcs that determine lambda, mu does not change w.  With k = w' / r the image of a straight edge
through p with the unit normal n = (u, v) there is the line l q = 0 of

    l(n) = (w u - k t y, w v + k t x, -(u x + v y)),  t = u y - v x,

linear in lambda and mu.  The same with the tangent instead of the normal, b, is the line at
right angles.  The image of the straight edge through p and the vanishing point v deviates from the
arc at p, *in the distorted image*, by the angle e with

    tan e = (l v) / (b v).

Residuals in the undistorted image would grow towards its rim, and would bias the estimate to a
lens that shrinks the image.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.lens.observation import RIM

# Standard deviation of an arc's angle: of the flaws of lens and edge, radians; and of its ends,
# radians times its length in px.  Residuals to the truth of annotated photographs (York Urban,
# 1.3 degrees at 20 px to .5 at 300); offset_std predicts 2 to 16 times less.
FLAW, ENDS = math.radians(0.3), math.radians(28.0)
# The same of arcs that are bent beyond the images of straight edges, over the angle by which they
# turn beyond them in half their length.  Residuals there: .6 times that angle between 1 and 8
# degrees, at any length from 25 to 800 px.
BENT = 0.6
# Squared radius (half diagonals) at which w does not depend on mu: between the mean over an image
# and its corners, as arcs that are far out determine lambda.
KNOT = 0.5
# Columns of an observation: middle, unit normal there, and standard deviation of its angle.
X, Y, NORMAL_X, NORMAL_Y, DEVIATION, COLUMNS = range(6)
# Rows of a table of lines: l, b and the inverse of deviation and variance.
ALONG, ACROSS, SHARPNESS, PRECISION, ROWS = 0, 3, 6, 7, 8

Line = tuple[float, float, float]


class Observed(NamedTuple):
    """
    Arcs as observations of directions, the longest first.

    Attributes
    ----------
    arcs
        (N,) int64, the arc of each observation.
    seen
        (N, COLUMNS) float64, lengths in half diagonals, angles in radians.

    """

    arcs: np.ndarray
    seen: np.ndarray


def excess(arcs: Arcs, lens: DivisionModel, deviation: float) -> np.ndarray:
    """
    Return by how much arcs are bent beyond the images of straight edges: (M,) radians.

    It is the angle by which an arc turns over half its length, as far as that exceeds its
    deviation, which is that of its curvature and of lambda.
    """
    table, unit = arcs.table, lens.half_diagonal
    chord = table['end'] - table['start']
    size = np.hypot(*chord.T)
    middle = (table['middle'] - lens.origin) / unit
    across = (chord[:, 0] * middle[:, 1] - chord[:, 1] * middle[:, 0]) / np.maximum(
        size, np.finfo(float).tiny)
    w = 1 - lens.lam * (middle ** 2).sum(axis=1)
    off = np.abs(table['curvature'] * unit - 2 * lens.lam * across / w)
    spread = np.hypot(table['curvature_std'] * unit, deviation * 2 * across / w ** 2)
    return np.asarray(np.maximum(off - spread, 0.0) * size / (2 * unit))


def observe(arcs: Arcs, lens: DivisionModel, turn: np.ndarray) -> Observed:
    """
    Return observations of the arcs that may be images of straight edges.

    Arcs without a length are left out, and circles about the distortion centre, which are the rim
    of a fisheye's image circle.  Of the lens, centre and unit of length count.  ``turn`` is the
    :func:`excess` of each arc, (M,) radians.
    """
    table = arcs.table
    chord = table['end'] - table['start']
    size = np.hypot(*chord.T)
    along = chord / np.maximum(size, np.finfo(float).tiny)[:, None]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    middle = (table['middle'] - lens.origin) / lens.half_diagonal
    bend = table['curvature'] * lens.half_diagonal
    is_rim = np.hypot(*(bend[:, None] * middle + normal).T) < RIM * np.abs(bend)
    order = np.argsort(-size, kind='stable')
    order = order[(size > 0)[order] & ~is_rim[order]]
    deviation = np.sqrt(FLAW ** 2 + (ENDS / size[order]) ** 2 + (BENT * turn[order]) ** 2)
    return Observed(order, np.column_stack([middle[order], normal[order], deviation]))


@inlined
def line(x: float, y: float, u: float, v: float, lens: tuple[float, float]) -> Line:
    """Return l for the point (x, y), the normal (u, v), and lambda and mu."""
    square, t = x * x + y * y, u * y - v * x
    w = 1 + square * (lens[0] + lens[1] * (square - KNOT))
    k = 2 * lens[0] + lens[1] * (4 * square - 2 * KNOT)
    return w * u - k * t * y, w * v + k * t * x, -u * x - v * y


@inlined
def bends(x: float, y: float, u: float, v: float) -> tuple[float, float, float, float]:
    """Return the derivatives of the first two parts of l by lambda and mu; the third's is 0."""
    square, t = x * x + y * y, u * y - v * x
    w, k = square * (square - KNOT), 4 * square - 2 * KNOT
    return (square * u - 2 * t * y, square * v + 2 * t * x, w * u - k * t * y, w * v + k * t * x)


def lines(seen: np.ndarray, lam: float, mu: float) -> np.ndarray:
    """Return the lines of observations with a lens: (ROWS, N), a row for each quantity."""
    rows = np.empty((ROWS, len(seen)))
    _lines(seen, lam, mu, rows)
    return rows


@compiled
def _lines(seen: np.ndarray, lam: float, mu: float, rows: np.ndarray) -> None:
    """Fill in the lines; the arguments are those of :func:`lines`."""
    lens = lam, mu
    for i in range(len(seen)):
        x, y, u, v = seen[i, X], seen[i, Y], seen[i, NORMAL_X], seen[i, NORMAL_Y]
        rows[0, i], rows[1, i], rows[2, i] = line(x, y, u, v, lens)
        rows[3, i], rows[4, i], rows[5, i] = line(x, y, v, -u, lens)
        rows[SHARPNESS, i] = 1 / seen[i, DEVIATION]
        rows[PRECISION, i] = rows[SHARPNESS, i] ** 2
