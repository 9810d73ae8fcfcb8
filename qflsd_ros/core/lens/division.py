"""
The one-parameter division model of lens distortion (paper, equation (2)).

``x_u = x_d / (1 + lambda r_d^2)`` with the origin at the distortion centre.  Lambda is normalised
throughout: ``r_d = 1`` at half the image's diagonal, which is the corner of the image when the
centre is the image's own.  A barrel (wide-angle, fisheye) has lambda < 0.  Pixels are square.

Reference: A. W. Fitzgibbon, Simultaneous linear estimation of multiple view geometry and lens
distortion, CVPR 2001.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qflsd_ros.core.arcs import Arcs

SAMPLES = 9     # points along an arc


@dataclass(frozen=True)
class DivisionModel:
    """
    A lens: ``lam`` (normalised, see the module), its centre in px, the image's (height, width).

    The centre is the image's own unless another is given: ``((W - 1) / 2, (H - 1) / 2)``.
    """

    lam: float
    shape: tuple[int, int]
    centre: tuple[float, float] | None = None

    @property
    def half_diagonal(self) -> float:
        """Half the image's diagonal in px: the unit of length in which lambda is given."""
        return float(np.hypot(*self.shape)) / 2

    @property
    def origin(self) -> np.ndarray:
        """Centre of distortion x, y in px."""
        height, width = self.shape
        return np.array(self.centre if self.centre is not None
                        else ((width - 1) / 2, (height - 1) / 2), float)

    @property
    def in_pixels(self) -> tuple[float, float, float]:
        """Lambda in 1 / px^2, and the centre of distortion x, y in px."""
        x, y = self.origin.tolist()
        return self.lam / self.half_diagonal ** 2, x, y

    def reduced(self, factor: int) -> DivisionModel:
        """
        Return the lens of the same image made smaller: a pixel of each factor x factor pixels.

        Blocks begin at (0, 0), as those of :meth:`Arcs.scaled`; rows and columns at the end that
        fill none are left out, for which lambda, in units of a shorter diagonal, makes up.
        """
        if factor == 1:
            return self
        height, width = self.shape
        shape = height // factor, width // factor
        share = factor * float(np.hypot(*shape)) / 2 / self.half_diagonal
        x, y = ((self.origin - (factor - 1) / 2) / factor).tolist()
        return DivisionModel(self.lam * share ** 2, shape, (x, y))

    def undistort(self, points: np.ndarray) -> np.ndarray:
        """
        Map image points to where a lens without distortion shows them; (..., 2) px.

        nan where such a lens shows nothing: from the radius 1 / sqrt(|lambda|) on, at which a
        barrel looks sideways and a pincushion folds the image over.
        """
        q = (np.asarray(points, float) - self.origin) / self.half_diagonal
        bend = self.lam * (q ** 2).sum(axis=-1, keepdims=True)
        with np.errstate(divide='ignore', invalid='ignore'):
            undistorted = q / (1 + bend) * self.half_diagonal + self.origin
        return np.where(np.abs(bend) < 1, undistorted, np.nan)

    def distort(self, points: np.ndarray) -> np.ndarray:
        """
        Map points of an image without distortion to where this lens shows them; (..., 2) px.

        Exact inverse of :meth:`undistort`; nan where this lens has no image of a point
        (lambda > 0 and too far out).
        """
        q = (np.asarray(points, float) - self.origin) / self.half_diagonal
        r2 = (q ** 2).sum(axis=-1, keepdims=True)
        with np.errstate(invalid='ignore'):
            root = np.sqrt(1 - 4 * self.lam * r2)
        return 2 * q / (1 + root) * self.half_diagonal + self.origin

    def curvature(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """
        Return how the pictures of straight edges are bent.

        From equation (4): an edge ``B x + C y + D = 0`` of the image without distortion is seen
        as ``lambda D (x^2 + y^2) + B x + C y + D = 0``.

        Parameters
        ----------
        points
            (..., 2) px, image points on the edges.
        normals
            (..., 2), unit normals of their pictures there.

        Returns
        -------
        curvature
            (...) 1/px, positive where a picture bends away from its normal.

        """
        q = (np.asarray(points, float) - self.origin) / self.half_diagonal
        across = (q * normals).sum(axis=-1)
        return -2 * self.lam * across / (1 - self.lam * (q ** 2).sum(axis=-1)) / self.half_diagonal


def rectified(arcs: Arcs, model: DivisionModel) -> np.ndarray:
    """
    Return arcs as the straight segments that a lens without distortion shows.

    Parameters
    ----------
    arcs
        The arcs of an image, of which each is taken for the picture of a straight edge.
    model
        The lens of that image.

    Returns
    -------
    segments
        (M, 2, 2) float64 px in the image without distortion, which has the same scale at the
        centre of distortion: start and end of each arc, on the straight line that is closest to
        the whole of it.  nan where an arc reaches to where such a lens shows nothing.

    """
    points = model.undistort(arcs.samples(SAMPLES))
    middle = points.mean(axis=1)
    off = points - middle[:, None]
    (xx, yy), xy = (off ** 2).sum(axis=1).T, (off[..., 0] * off[..., 1]).sum(axis=1)
    angle = np.arctan2(2 * xy, xx - yy) / 2     # of the axis of least inertia
    along = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None]
    ends = off[:, [0, -1]]
    return middle[:, None] + (ends * along).sum(axis=-1, keepdims=True) * along
