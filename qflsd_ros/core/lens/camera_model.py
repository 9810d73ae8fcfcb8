"""
A calibrated camera: the viewing direction of each pixel, by the models of ROS's CameraInfo.

Directions are in the optical frame: x right, y down, z forward along the optical axis.

References: OpenCV's calib3d for ``plumb_bob`` and ``rational_polynomial``; J. Kannala and
S. S. Brandt, A generic camera model and calibration method for conventional, wide-angle, and
fish-eye lenses, PAMI 2006, for ``equidistant``.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Greatest number of coefficients of each model, in OpenCV's order: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2
# s3 s4 for the first two, k1 to k4 for equidistant.
SIZES = {'plumb_bob': 5, 'rational_polynomial': 12, 'equidistant': 4}
# Newton's method doubles the number of correct digits in each iteration near the solution; points
# near the border of a strong distortion need some iterations to come near it.
ITERATIONS = 20
# Shares of the radius for which each iteration of a pinhole solves.  A pincushion needs those
# before 1: steps from the centre straight to the border may end on another branch of the rational
# polynomial.
SHARES = (0.25, 0.5, 0.75) + (1.0,) * ITERATIONS
# Difference for derivatives, in focal lengths: small against any detail of a distortion, large
# against the rounding of float64.  Newton's method needs no exact derivatives.
STEP = 1e-6
# Greatest residual of a solution, in focal lengths or radians: below 1e-6 px at any focal length
# of up to 1000 px, far above rounding.
EXACT = 1e-9
# Step after which iterations end, in focal lengths: the residual before it was below EXACT, even
# where a pincushion stretches the image tenfold.
SETTLED = 1e-10


@dataclass(frozen=True)
class CameraModel:
    """
    The camera matrix and the distortion of a calibrated camera.

    Attributes
    ----------
    model
        Name of the distortion model, a key of :data:`SIZES`.
    matrix
        (3, 3) float64, the camera matrix K in px.
    coefficients
        (12,) float64, the distortion coefficients D, padded with zeros.

    Raises
    ------
    ValueError
        The model is unknown or has too many coefficients; the matrix has no focal length above
        0; or a number is not finite.

    """

    model: str
    matrix: np.ndarray
    coefficients: np.ndarray

    def __post_init__(self) -> None:
        """Check the numbers, and pad the coefficients with zeros."""
        if self.model not in SIZES:
            raise ValueError(f'distortion model is {self.model!r}: must be one of '
                             f'{", ".join(SIZES)}')
        given = np.asarray(self.coefficients, float)
        # Zeros beyond are accepted: OpenCV writes 14 numbers, the last two for a tilted sensor.
        size = SIZES[self.model]
        if given[size:].any():
            raise ValueError(f'{self.model} has {len(given)} distortion coefficients: '
                             f'must have at most {size}')
        matrix = np.asarray(self.matrix, float)
        if not (np.isfinite(matrix).all() and np.isfinite(given).all()
                and matrix[0, 0] > 0 and matrix[1, 1] > 0):
            raise ValueError('camera matrix K has no focal length above 0, or K or D has numbers '
                             'that are not finite: the camera is not calibrated')
        full = np.zeros(max(12, size))
        full[:min(len(given), size)] = given[:size]
        object.__setattr__(self, 'matrix', matrix)
        object.__setattr__(self, 'coefficients', full)

    def rays(self, points: np.ndarray) -> np.ndarray:
        """
        Return the viewing directions of image points.

        Parameters
        ----------
        points
            (..., 2) float64 px; (0, 0) is the centre of the top-left pixel.

        Returns
        -------
        directions
            (..., 3) float64 unit vectors in the optical frame; nan for a point to which the model
            maps no direction.

        """
        (fx, skew, cx), (_, fy, cy) = self.matrix[:2]
        y = (points[..., 1] - cy) / fy
        x = (points[..., 0] - cx - skew * y) / fx
        if self.model == 'equidistant':
            return _equidistant(x, y, self.coefficients)
        return _pinhole(x, y, self.coefficients)


def _equidistant(x: np.ndarray, y: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """
    Return the directions of normalised points under the equidistant model.

    Newton's method solves theta (1 + k1 theta^2 + k2 theta^4 + ...) = |(x, y)| for the angle
    theta from the optical axis.
    """
    k1, k2, k3, k4 = coefficients[:4]
    radius = np.hypot(x, y)
    theta = np.minimum(radius, np.pi)
    for _ in range(ITERATIONS):
        t = theta * theta
        off = theta * (1 + t * (k1 + t * (k2 + t * (k3 + t * k4)))) - radius
        slope = 1 + t * (3 * k1 + t * (5 * k2 + t * (7 * k3 + t * 9 * k4)))
        with np.errstate(divide='ignore', invalid='ignore'):
            theta = theta - off / slope
    wrong = ~((np.abs(off) < EXACT) & (slope > 0) & (theta >= 0) & (theta <= np.pi))
    theta[wrong] = np.nan
    side = np.sinc(theta / np.pi) * np.divide(theta, radius, np.ones_like(theta), where=radius > 0)
    return np.stack([side * x, side * y, np.cos(theta)], axis=-1)


def _pinhole(x: np.ndarray, y: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """
    Return the directions of normalised points under the polynomial models.

    Newton's method finds the undistorted point (u, v) that the model distorts to (x, y), by way of
    those that it distorts to shares of (x, y).
    """
    u, v = SHARES[0] * x, SHARES[0] * y
    with np.errstate(all='ignore'):
        for share in SHARES:
            (a, b), (du, dv) = _distorted(u, v, coefficients), (u + STEP, v + STEP)
            (au, bu), (av, bv) = _distorted(du, v, coefficients), _distorted(u, dv, coefficients)
            ju, jv, ku, kv = ((one - other) / STEP for one, other in (
                (au, a), (av, a), (bu, b), (bv, b)))
            determinant = ju * kv - jv * ku
            a, b = a - share * x, b - share * y
            step_u, step_v = (kv * a - jv * b) / determinant, (ju * b - ku * a) / determinant
            u, v = u - step_u, v - step_v
            if share == 1 and not (np.abs(step_u) + np.abs(step_v) > SETTLED).any():
                break
    # A solution does not count where the distortion folds the image over (determinant below 0)
    # or mirrors it through the centre.
    wrong = ~((np.hypot(a, b) < EXACT) & (determinant > 0) & (u * x + v * y >= 0))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1)
    rays[wrong] = np.nan
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def _distorted(u: np.ndarray, v: np.ndarray,
               coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Distort normalised coordinates by the rational polynomial.

    ``plumb_bob`` is the special case in which k4 to s4 are 0.
    """
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = coefficients
    r = u * u + v * v
    radial = (1 + r * (k1 + r * (k2 + r * k3))) / (1 + r * (k4 + r * (k5 + r * k6)))
    return (u * radial + 2 * p1 * u * v + p2 * (r + 2 * u * u) + r * (s1 + r * s2),
            v * radial + p1 * (r + 2 * v * v) + 2 * p2 * u * v + r * (s3 + r * s4))
