"""
Observations of a lens: the curvature of each arc, and where it was measured.

Unit of length: half the image's diagonal; origin: the image centre.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.circle import CurvatureLimits, fit, FIT_SIZE, UNKNOWN_LENS
from qflsd_ros.core.compilation import compiled
from qflsd_ros.core.lens.division import DivisionModel

# All of these are chosen, not tuned, unless stated otherwise.
# Edge points that are ignored at each end, where the blur of the gradient rounds corners; and
# points that must remain, more than twice the three unknowns of a circle.
CORNER, LEAST_POINTS = 3, 8
# Sagitta by which real edges are bent, px: the accuracy of edge points on photographs.
STRAY = 0.1
# An arc is informative if it alone determines lambda to this standard deviation, the order of
# lambda itself.
INFORMATIVE = 1.0
# A circle whose centre is closer than this to the image centre is taken for the rim of a fisheye's
# image circle, which is centred to a few percent of the diagonal.
RIM = 0.05
ANY_CURVATURE = CurvatureLimits(0.0, math.inf, UNKNOWN_LENS)
# Columns of an observation: curvature, its variance by noise alone and with STRAY, the unit normal
# (2 columns), and the point (2 columns).
CURVATURE, NOISE, VARIANCE, NORMAL, POINT, COLUMNS = 0, 1, 2, 3, 5, 7


class Edges(NamedTuple):
    """The edge points of M arcs, as the kernel takes them."""

    points: np.ndarray      # (2, E) float64, x and y of those of all arcs, px
    offsets: np.ndarray     # (M + 1,) int64: arc i has the points offsets[i] to offsets[i + 1] - 1
    lengths: np.ndarray     # (M,) float32, of the arcs, px


def observe(arcs: Arcs, shape: tuple[int, int]) -> np.ndarray:
    """
    Return the observation of each arc: (M, COLUMNS) float64, nan for arcs with too few points.

    The curvature is fitted anew, since the one in the table is 0 where it is not significant and
    includes the ends, where the gradient's blur rounds corners.
    """
    seen = np.full((len(arcs), COLUMNS), np.nan)
    edges = Edges(np.ascontiguousarray(arcs.edge_points.T), arcs.offsets,
                  np.ascontiguousarray(arcs.table['length']))
    _observe(edges, DivisionModel(0.0, shape).origin, float(np.hypot(*shape)) / 2,
             np.empty((1, FIT_SIZE)), seen)
    return seen


@compiled
def _observe(edges: Edges, origin: np.ndarray, unit: float, fits: np.ndarray,
             seen: np.ndarray) -> None:
    """
    Fill in the observations of arcs.

    ``origin`` and ``unit`` are the image centre and half the image's diagonal, px; ``fits`` is
    scratch, (1, FIT_SIZE).
    """
    for i in range(len(seen)):
        first, last = edges.offsets[i] + CORNER, edges.offsets[i + 1] - 1 - CORNER
        if last - first + 1 < LEAST_POINTS or not fit(edges.points, (first, last), 0.0,
                                                      ANY_CURVATURE, fits, 0):
            continue
        x, y = fits[0, circle.X0], fits[0, circle.Y0]
        A, B, C, D = circle.curve(fits, 0)
        size = math.sqrt(B * B + C * C)
        off = 2 * D / (1 + size)
        seen[i, CURVATURE] = 2 * A * unit
        seen[i, NOISE] = 4 * fits[0, circle.VAR_A] * unit ** 2
        seen[i, VARIANCE] = seen[i, NOISE] + (8 * STRAY * unit / edges.lengths[i] ** 2) ** 2
        seen[i, NORMAL], seen[i, NORMAL + 1] = B / size, C / size
        seen[i, POINT] = (x - off * B / size - origin[0]) / unit
        seen[i, POINT + 1] = (y - off * C / size - origin[1]) / unit


def informative(seen: np.ndarray) -> np.ndarray:
    """Return the observations that depend on lambda enough and are not of a fisheye's rim."""
    bend, normal, point = seen[:, [CURVATURE]], seen[:, NORMAL:POINT], seen[:, POINT:]
    across = (normal * point).sum(axis=1)
    is_rim = np.hypot(*(bend * point - normal).T) < RIM * np.abs(bend[:, 0])
    return seen[(4 * across ** 2 * INFORMATIVE ** 2 > seen[:, VARIANCE]) & ~is_rim]
