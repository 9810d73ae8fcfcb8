"""
The division model in the terms of ROS's CameraInfo, which does not have that model.

A model of CameraInfo is fitted to the division model over the whole image: the rational
polynomial, which is nearly exact for moderate lenses; or else ``equidistant``, a polynomial in the
angle from the optical axis, which is nearly exact for fisheyes near their natural focal length,
also beyond 90 degrees.  For other fisheyes, the rational polynomial is fitted to the part of the
image that the rectified image shows, where it is nearly exact for every lens.

Like the division model, the fitted models assume square pixels.  The distortion centre serves as
the principal point.

Unit of length inside this module: half the image's diagonal.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.lens.division import DivisionModel

# All of these are chosen, not tuned, unless stated otherwise.
# Radii at which the models are compared.  Both are smooth: between neighbours, .5 % of the image
# apart, the difference is not much larger than at them (tested).
RADII = 200
# Greatest difference from the division model anywhere in the image, px: for the rational
# polynomial half the accuracy of edge points, .1 px; for a fisheye twice that accuracy, since the
# alternative describes only a part of the image.
CLOSE = {'rational_polynomial': 0.05, 'equidistant': 0.2}
# A part is fitted up to this multiple of the radius of the rectified image, a margin for
# rectified images that are larger than the image.
SHOWN = 1.5
# The fit of a pincushion ends at this share of the radius where it folds the image over: the
# derivative is infinite there.
FOLD = 0.99
# CameraInfo's formats: k1 k2 k3 above and k4 k5 k6 below the line of the rational polynomial, and
# k1 to k4 of equidistant.
TERMS, ANGLE_TERMS = 3, 4
# Rounds of the linearised fit; the denominator is settled after 3 or 4.
REWEIGHTINGS = 5
# Singular values below this share of the largest count as 0 in least squares: float64 resolves
# 2e-16, and the powers are nearly dependent.
RANK = 1e-14


class CameraInfoTerms(NamedTuple):
    """
    A lens in the terms of sensor_msgs/CameraInfo.

    Attributes
    ----------
    distortion_model
        ``rational_polynomial`` or ``equidistant``.
    coefficients
        (8,) or (4,) float64, D.
    matrix
        (3, 3) float64, K in px.
    radius
        Distance from the distortion centre, px, up to which the model is fitted: to the farthest
        corner of the image, or less if only a part of the image is fitted.
    residual
        Greatest distance, px, between the fitted model and the division model up to ``radius``.

    """

    distortion_model: str
    coefficients: np.ndarray
    matrix: np.ndarray
    radius: float
    residual: float


def camera_info_terms(lens: DivisionModel, focal_length: float = 0.0) -> CameraInfoTerms:
    """
    Fit a model of CameraInfo to a lens.

    Parameters
    ----------
    lens
        The lens.
    focal_length
        Focal length at the distortion centre, px.  Straight edges do not determine it; 0 stands
        for :func:`natural_focal_length`.  It does not change the rectified image by more than
        0.2 px if that has the scale of the image at the centre.  For a fisheye (lambda below
        about -0.8) and a focal length far from the natural one, only the part of the image that
        the rectified image shows is fitted.

    """
    focal_length = focal_length or natural_focal_length(lens)
    unit, lam = lens.half_diagonal, lens.lam
    whole, part = _reaches(lens)
    for name, fit, radius in (('rational_polynomial', _rational, whole),
                              ('equidistant', _equidistant, whole),
                              ('rational_polynomial', _rational, part)):
        coefficients, miss = fit(lam, np.linspace(0, radius, RADII + 1)[1:], focal_length / unit)
        if unit * miss <= CLOSE[name]:
            break
    return CameraInfoTerms(name, coefficients, _matrix(lens, focal_length), unit * radius,
                           unit * miss)


def calibration_terms(lens: DivisionModel, focal_length: float) -> CameraInfoTerms:
    """
    Fit a model of CameraInfo to a lens of known focal length, all over the image.

    Of ``rational_polynomial`` and ``equidistant``, the result is the one with the smaller
    residual.  :func:`camera_info_terms` serves rectification instead, and may leave out a part of
    the image for that.

    Parameters
    ----------
    lens
        The lens.
    focal_length
        Its focal length at the distortion centre, px.

    """
    radii, unit = np.linspace(0, _reaches(lens)[0], RADII + 1)[1:], lens.half_diagonal
    fits = {name: fit(lens.lam, radii, focal_length / unit)
            for name, fit in (('rational_polynomial', _rational), ('equidistant', _equidistant))}
    name, (coefficients, miss) = min(fits.items(), key=lambda item: item[1][1])
    return CameraInfoTerms(name, coefficients, _matrix(lens, focal_length),
                           unit * float(radii[-1]), unit * miss)


def _matrix(lens: DivisionModel, focal_length: float) -> np.ndarray:
    """Return the camera matrix K of square pixels about the distortion centre, (3, 3) px."""
    x, y = lens.origin
    return np.array([[focal_length, 0, x], [0, focal_length, y], [0, 0, 1]])


def _reaches(lens: DivisionModel) -> tuple[float, float]:
    """Return the radius of the whole image, and of the part that a rectified image shows."""
    lam, (x, y), (height, width) = lens.lam, lens.origin, lens.shape
    corner = math.hypot(max(x, width - 1 - x), max(y, height - 1 - y)) / lens.half_diagonal
    whole = min(corner, FOLD / math.sqrt(lam)) if lam > 0 else corner
    shown = SHOWN * corner      # in the rectified image, hence distorted below
    part = min(whole, 2 * shown / (1 + math.sqrt(1 - 4 * min(lam, 0) * shown ** 2)))
    return whole, part


def natural_focal_length(lens: DivisionModel) -> float:
    """
    Return a plausible focal length of a lens, px.

    A barrel with the focal length 1 / sqrt(-4 lambda) is stereographic (r_d = 2 f tan(theta / 2)),
    which most fisheyes are approximately.  The result is at most half the image's diagonal, a
    field of view of 90 degrees over the diagonal without distortion.
    """
    return lens.half_diagonal * min(1.0, 0.5 / math.sqrt(max(-lens.lam, 0.25)))


def _rational(lam: float, radii: np.ndarray, focal: float) -> tuple[np.ndarray, float]:
    """
    Fit (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3), s = r^2, to r_d / r.

    Parameters
    ----------
    lam, focal
        Lambda, and the focal length in half diagonals.
    radii
        (RADII,) radii r_d in the image, ascending.

    Returns
    -------
    coefficients, miss
        (8,), and the greatest difference in r_d; infinite if the undistorted image does not reach
        the largest radius.

    """
    if abs(lam) * radii[-1] ** 2 >= 1:
        return np.zeros(8), math.inf
    straight = radii / (1 + lam * radii ** 2)
    square = (straight / straight[-1]) ** 2
    powers = square[:, None] ** np.arange(1, TERMS + 1)
    design = np.concatenate([straight[:, None] * powers, -radii[:, None] * powers], axis=1)
    below = np.ones(RADII)
    for _ in range(REWEIGHTINGS):
        # The error times the denominator is linear in the coefficients; division by the
        # denominator of the previous round makes it the error itself.
        solution = np.linalg.lstsq(design / below[:, None], (radii - straight) / below, RANK)[0]
        below = 1 + powers @ solution[TERMS:]
    miss = np.abs(straight * (1 + powers @ solution[:TERMS]) / below - radii).max()
    k = solution * np.tile((focal / straight[-1]) ** (2 * np.arange(1, TERMS + 1)), 2)
    return np.array([k[0], k[1], 0, 0, *k[2:]]), miss if below.min() > 0 else math.inf


def _equidistant(lam: float, radii: np.ndarray, focal: float) -> tuple[np.ndarray, float]:
    """
    Fit theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8) to r_d / f.

    Parameters and results are those of :func:`_rational`, with (4,) coefficients.
    """
    angles = np.arctan2(radii, focal * (1 + lam * radii ** 2))
    powers = angles[:, None] ** (2 * np.arange(1, ANGLE_TERMS + 1) + 1)
    solution = np.linalg.lstsq(powers, radii / focal - angles, RANK)[0]
    miss = focal * np.abs(angles + powers @ solution - radii / focal).max()
    return solution, miss
