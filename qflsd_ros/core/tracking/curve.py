"""
Arcs through three points: start, middle and end.

In the frame of its chord (origin halfway, u along it, the normal to the right of travel) an arc
with sagitta h over the half chord c has the curvature k = 2 h / (h^2 + c^2), and

    v(t) = h - k t^2 / (1 + sqrt(1 - k^2 t^2)),  tangent (sqrt(1 - k^2 t^2), -k t),

which holds for straight lines (k = 0), too.  Arcs turn by less than half a turn.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import inlined
from qflsd_ros.core.tracking.state import END, MIDDLE, START

# Least cosine between tangent and chord, just short of half a turn; chosen, not tuned.
STEEPEST = 0.05

# Origin x, y, direction x, y, half chord, sagitta, curvature.
Curve = tuple[float, float, float, float, float, float, float]
NUMBERS = 7         # of a curve


@inlined
def curve(rows: np.ndarray, i: int) -> Curve:
    """Return the arc of row i in the frame of its chord."""
    x0, y0, x1, y1 = rows[i, START], rows[i, START + 1], rows[i, END], rows[i, END + 1]
    cx, cy = x1 - x0, y1 - y0
    chord = max(math.sqrt(cx * cx + cy * cy), 1e-6)
    ux, uy, ox, oy = cx / chord, cy / chord, (x0 + x1) / 2, (y0 + y1) / 2
    h = (rows[i, MIDDLE + 1] - oy) * ux - (rows[i, MIDDLE] - ox) * uy
    return ox, oy, ux, uy, chord / 2, h, 2 * h / (h * h + chord * chord / 4)


@inlined
def at(arc: Curve, share: float) -> tuple[float, float, float, float]:
    """
    Return a point x, y of an arc, px, and the unit normal there, right of travel.

    ``share`` is the position along the chord: -1 at the start, 0 halfway, 1 at the end.
    """
    ox, oy, ux, uy, half, h, k = arc
    t = share * half
    c = math.sqrt(max(1 - k * k * t * t, STEEPEST * STEEPEST))
    s = -k * t
    v = h - k * t * t / (1 + c)
    return ox + t * ux - v * uy, oy + t * uy + v * ux, -s * ux - c * uy, -s * uy + c * ux


@inlined
def place(arc: Curve, x: float, y: float) -> tuple[float, float]:
    """Return a point's position along the chord (-1 to 1 on the arc), and px right of the arc."""
    ox, oy, ux, uy, half, h, k = arc
    t = (x - ox) * ux + (y - oy) * uy
    c = math.sqrt(max(1 - k * k * t * t, STEEPEST * STEEPEST))
    return t / half, ((y - oy) * ux - (x - ox) * uy - h + k * t * t / (1 + c)) * c


@inlined
def beside(arc: Curve, x: float, y: float) -> tuple[float, float, float, float]:
    """Return what :func:`place` returns, and the unit normal of the arc beside the point."""
    ox, oy, ux, uy, half, h, k = arc
    t = (x - ox) * ux + (y - oy) * uy
    s = k * t
    c = math.sqrt(max(1 - s * s, STEEPEST * STEEPEST))
    off = ((y - oy) * ux - (x - ox) * uy - h + s * t / (1 + c)) * c
    return t / half, off, s * ux - c * uy, s * uy + c * ux


@inlined
def length(arc: Curve) -> float:
    """Return the length of an arc, px."""
    turn = abs(arc[6]) * arc[4]
    return 2 * arc[4] * (math.asin(min(turn, 1.0)) / turn if turn > 1e-6 else 1.0)
