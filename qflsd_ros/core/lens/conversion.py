"""
The division model in the terms of ROS's CameraInfo, which does not know it.

Its maps are fitted by a rational polynomial, which is all but exact for moderate lenses, or by
the polynomial in the angle that is called equidistant, which is so for fisheyes of about their
natural focal length, also for what they see behind the camera.  For other fisheyes the rational
polynomial is fitted to the part that a rectified image shows, where it is all but exact for all.

Like the division model they hold for square pixels; the centre of distortion is taken for the
principal point, too.

Unit of length: half the image's diagonal.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.lens.division import DivisionModel

RADII = 200         # at which the maps are compared; between them they differ by little more
# px, by which either may miss the division model all over the image: for the rational polynomial
# well below what edges are located to, .1 px; for a fisheye twice that, rather than only a part.
CLOSE = {'rational_polynomial': 0.05, 'equidistant': 0.2}
SHOWN = 1.5         # radius up to which a part is fitted, of that which a rectified image shows
FOLD = 0.99         # share of the radius at which a pincushion folds over that is fitted
TERMS = 3           # of the rational polynomial, above and below
ANGLE_TERMS = 4
REWEIGHTINGS = 5


class Calibration(NamedTuple):
    """
    A camera as CameraInfo describes it.

    Attributes
    ----------
    distortion_model
        ``rational_polynomial`` or ``equidistant``.
    coefficients
        (8,) or (4,) float64, D.
    matrix
        (3, 3) float64, K in px.
    radius
        Distance from the centre of distortion in px up to which it is fitted: to the farthest
        corner of the image, or less where only a part is.
    residual
        Largest distance in px by which it misses the division model up to there.

    """

    distortion_model: str
    coefficients: np.ndarray
    matrix: np.ndarray
    radius: float
    residual: float


def calibration(model: DivisionModel, focal_length: float = 0.0) -> Calibration:
    """
    Return the camera that has a lens.

    Parameters
    ----------
    model
        The lens.
    focal_length
        Focal length in px at the centre, which straight edges alone do not tell; 0 stands for
        :func:`natural_focal_length`.  The rectified image, of the scale of the raw one at the
        centre, is the same with any to within 0.2 px.  Of a fisheye, lambda below about -0.8,
        only the part around it is described where the focal length is far from the natural one.

    """
    focal_length = focal_length or natural_focal_length(model)
    unit, lam = model.half_diagonal, model.lam
    x, y = model.origin
    height, width = model.shape
    corner = math.hypot(max(x, width - 1 - x), max(y, height - 1 - y)) / unit
    whole = min(corner, FOLD / math.sqrt(lam)) if lam > 0 else corner
    shown = SHOWN * corner      # of the rectified image
    part = min(whole, 2 * shown / (1 + math.sqrt(1 - 4 * min(lam, 0) * shown ** 2)))
    for name, fit, radius in (('rational_polynomial', _rational, whole),
                              ('equidistant', _equidistant, whole),
                              ('rational_polynomial', _rational, part)):
        coefficients, miss = fit(lam, np.linspace(0, radius, RADII + 1)[1:], focal_length / unit)
        if unit * miss <= CLOSE[name]:
            break
    matrix = np.array([[focal_length, 0, x], [0, focal_length, y], [0, 0, 1]])
    return Calibration(name, coefficients, matrix, unit * radius, unit * miss)


def natural_focal_length(model: DivisionModel) -> float:
    """
    Return a focal length that a lens may well have, px.

    That at which a barrel is stereographic, as fisheyes are by and large, but at most half the
    image's diagonal.
    """
    return model.half_diagonal * min(1.0, 0.5 / math.sqrt(max(-model.lam, 0.25)))


def _rational(lam: float, radii: np.ndarray, focal: float) -> tuple[np.ndarray, float]:
    """Fit (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3), s = r^2, to r_d / r."""
    if abs(lam) * radii[-1] ** 2 >= 1:
        return np.zeros(8), math.inf  # an undistorted image has no corners
    straight = radii / (1 + lam * radii ** 2)
    square = (straight / straight[-1]) ** 2
    powers = square[:, None] ** np.arange(1, TERMS + 1)
    design = np.concatenate([straight[:, None] * powers, -radii[:, None] * powers], axis=1)
    below = np.ones(RADII)
    for _ in range(REWEIGHTINGS):
        # What is linear in the coefficients is the error times the denominator.
        solution = np.linalg.lstsq(design / below[:, None], (radii - straight) / below, 1e-14)[0]
        below = 1 + powers @ solution[TERMS:]
    miss = np.abs(straight * (1 + powers @ solution[:TERMS]) / below - radii).max()
    k = solution * np.tile((focal / straight[-1]) ** (2 * np.arange(1, TERMS + 1)), 2)
    return np.array([k[0], k[1], 0, 0, *k[2:]]), miss if below.min() > 0 else math.inf


def _equidistant(lam: float, radii: np.ndarray, focal: float) -> tuple[np.ndarray, float]:
    """Fit theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8) to r_d / f."""
    angles = np.arctan2(radii, focal * (1 + lam * radii ** 2))
    powers = angles[:, None] ** (2 * np.arange(1, ANGLE_TERMS + 1) + 1)
    solution = np.linalg.lstsq(powers, radii / focal - angles, 1e-14)[0]
    miss = focal * np.abs(angles + powers @ solution - radii / focal).max()
    return solution, miss
