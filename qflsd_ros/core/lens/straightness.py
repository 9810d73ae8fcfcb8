"""
Comparison of arcs with the images of straight edges through a lens.

The curvature k of an arc of a straight edge differs from that of the edge's image, k(lens), by the
errors of arc and lens.  Other arcs have any curvature.  The likelihood of an arc is therefore

    (1 - OUTLIERS) t(k - k(lens)) + OUTLIERS / (range of curvatures)

where t is Student's distribution with 3 degrees of freedom.

Unit of length: half the image's diagonal; origin: the image centre.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.compilation import compiled
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.lens.observation import CURVATURE, NORMAL, observe, POINT, VARIANCE

# All of these are chosen, not tuned, unless stated otherwise.
# Share of arcs that are not images of straight edges; their curvatures are spread evenly over
# -10 / 3 to 10 / 3, which is a radius of .3.
OUTLIERS = 0.1
OUTLIER_DENSITY = OUTLIERS / (2 * 10 / 3)   # of a curvature, half diagonals
# Density of Student's distribution with 3 degrees of freedom at 0, times the share of inliers.
STUDENT = (1 - OUTLIERS) * 2 / (math.pi * math.sqrt(3))
# Deviation of lambda (times (1 - lambda / 3)^2) by which real lenses leave the division model
# locally.
LENS_ERROR = 0.01


def straightness(arcs: Arcs, lens: DivisionModel | None) -> np.ndarray:
    """
    Return the probability of each arc that it is the image of a straight edge.

    Parameters
    ----------
    arcs
        The arcs of an image.
    lens
        The lens of that image, None if it is unknown.

    Returns
    -------
    probability
        (M,) float64, near 0 for circles; nan for arcs with too few edge points for a curvature,
        and without a lens.

    """
    return np.full(len(arcs), np.nan) if lens is None else excess_bend(arcs, lens)[1]


def excess_bend(arcs: Arcs, lens: DivisionModel) -> tuple[np.ndarray, np.ndarray]:
    """
    Compare arcs with the images of straight edges through a lens.

    Returns
    -------
    curvature
        (M,) float64, by how much arcs bend more, 1/px; nan for arcs with too few edge points.
    probability
        (M,) float64, as :func:`straightness`.

    """
    seen = observe(arcs, lens.shape)
    shift = (lens.origin - DivisionModel(0.0, lens.shape).origin) / lens.half_diagonal
    found = compared(seen, np.array([lens.lam, *shift]), np.zeros((2, 2)))
    return found[:, 0] / lens.half_diagonal, found[:, 4]


def with_straightness(arcs: Arcs, lens: DivisionModel | None) -> Arcs:
    """Return the arcs with their :func:`straightness` in the column ``straight`` of the table."""
    return arcs.with_columns(straight=straightness(arcs, lens))


def compared(seen: np.ndarray, lens: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """
    Compare observations with a lens.

    Parameters
    ----------
    seen
        (N, COLUMNS), as returned by :func:`observe`.
    lens
        (3,) lambda and the distortion centre.
    spread
        (2, 2) covariance of that centre.

    Returns
    -------
    found
        (N, 6): the residual k - k(lens); the derivatives of k(lens) by lambda and by the centre's
        x and y; the probability that the edge is straight; the weight in least squares.

    """
    found = np.empty((len(seen), 6))
    _compare(seen, lens, spread, found)
    return found


@compiled
def _compare(seen: np.ndarray, lens: np.ndarray, spread: np.ndarray, found: np.ndarray) -> None:
    """Fill in the comparison; the arguments are those of :func:`compared`."""
    lam = lens[0]
    lens_error = (LENS_ERROR * (1 - lam / 3) ** 2) ** 2
    for i in range(len(seen)):
        u, v = seen[i, NORMAL], seen[i, NORMAL + 1]
        x, y = seen[i, POINT] - lens[1], seen[i, POINT + 1] - lens[2]
        fall = 1 - lam * (x * x + y * y)
        part = (u * x + v * y) / fall
        error, slope = seen[i, CURVATURE] + 2 * lam * part, -2 * part / fall
        across = 2 * lam * (u + 2 * lam * part * x) / fall
        along = 2 * lam * (v + 2 * lam * part * y) / fall
        variance = (seen[i, VARIANCE] + slope * slope * lens_error + across * across * spread[0, 0]
                    + 2 * across * along * spread[0, 1] + along * along * spread[1, 1])
        square = error * error / variance
        density = STUDENT / math.sqrt(variance) / (1 + square / 3) ** 2
        straight = density / (density + OUTLIER_DENSITY)
        found[i, 0], found[i, 1], found[i, 2], found[i, 3] = error, slope, across, along
        found[i, 4], found[i, 5] = straight, straight * 4 / (3 + square) / variance
