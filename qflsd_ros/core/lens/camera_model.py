"""
A calibrated camera: which way each pixel looks.  The models are those of ROS's CameraInfo.

Direction: x right, y down, z along the optical axis.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Coefficients at most: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4, as OpenCV orders them; or k1 to k4.
SIZES = {'plumb_bob': 5, 'rational_polynomial': 12, 'equidistant': 4}
ITERATIONS = 20
STEP = 1e-6         # for derivatives, in units of the focal length or radians
EXACT = 1e-9        # in the same units: what is farther off after all iterations has no solution


@dataclass(frozen=True)
class Lens:
    """
    Matrix and distortion of a camera.

    Attributes
    ----------
    model
        One of :data:`SIZES`.
    matrix
        (3, 3) float64, K in px.
    coefficients
        float64, D; what is not given is 0.

    Raises
    ------
    ValueError
        The model is unknown, has too many coefficients, or the matrix has no focal length.

    """

    model: str
    matrix: np.ndarray
    coefficients: np.ndarray

    def __post_init__(self) -> None:
        """Check what is given, and fill up the coefficients."""
        if self.model not in SIZES:
            raise ValueError(f'distortion model is {self.model!r}: must be one of '
                             f'{", ".join(SIZES)}')
        given = np.asarray(self.coefficients, float)
        # What rational_polynomial may have beyond, a tilted sensor, is accepted where it is 0.
        size = SIZES[self.model]
        if given[size:].any():
            raise ValueError(f'{self.model} has {len(given)} distortion coefficients: '
                             f'must have at most {size}')
        matrix = np.asarray(self.matrix, float)
        if not (np.isfinite(matrix).all() and np.isfinite(given).all()
                and matrix[0, 0] > 0 and matrix[1, 1] > 0):
            raise ValueError('camera matrix K has no focal length above 0, or not all is finite: '
                             'the camera is not calibrated')
        full = np.zeros(max(12, size))
        full[:min(len(given), size)] = given[:size]
        object.__setattr__(self, 'matrix', matrix)
        object.__setattr__(self, 'coefficients', full)

    def rays(self, points: np.ndarray) -> np.ndarray:
        """
        Return the directions in which pixels look.

        Parameters
        ----------
        points
            (..., 2) float64 px.

        Returns
        -------
        directions
            (..., 3) float64 of length 1; nan where the model maps no direction to a point.

        """
        (fx, skew, cx), (_, fy, cy) = self.matrix[:2]
        y = (points[..., 1] - cy) / fy
        x = (points[..., 0] - cx - skew * y) / fx
        if self.model == 'equidistant':
            return _equidistant(x, y, self.coefficients)
        return _pinhole(x, y, self.coefficients)


def _equidistant(x: np.ndarray, y: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Solve theta (1 + k1 theta^2 + k2 theta^4 + ...) = |x, y| by Newton's method."""
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
    """Find what is distorted to x, y by Newton's method."""
    u, v = x.copy(), y.copy()
    with np.errstate(all='ignore'):
        for _ in range(ITERATIONS):
            (a, b), (du, dv) = _distorted(u, v, coefficients), (u + STEP, v + STEP)
            (au, bu), (av, bv) = _distorted(du, v, coefficients), _distorted(u, dv, coefficients)
            ju, jv, ku, kv = ((one - other) / STEP for one, other in (
                (au, a), (av, a), (bu, b), (bv, b)))
            determinant = ju * kv - jv * ku
            a, b = a - x, b - y
            u = u - (kv * a - jv * b) / determinant
            v = v - (ju * b - ku * a) / determinant
    # Where the distortion folds the image over, or turns it inside out, a solution is none.
    wrong = ~((np.hypot(a, b) < EXACT) & (determinant > 0) & (u * x + v * y >= 0))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1)
    rays[wrong] = np.nan
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def _distorted(u: np.ndarray, v: np.ndarray,
               coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Apply the rational polynomial, which plumb_bob is part of, to normalised coordinates."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = coefficients
    r = u * u + v * v
    radial = (1 + r * (k1 + r * (k2 + r * k3))) / (1 + r * (k4 + r * (k5 + r * k6)))
    return (u * radial + 2 * p1 * u * v + p2 * (r + 2 * u * u) + r * (s1 + r * s2),
            v * radial + p1 * (r + 2 * v * v) + 2 * p2 * u * v + r * (s3 + r * s4))
