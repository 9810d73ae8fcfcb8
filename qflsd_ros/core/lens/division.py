"""
The one-parameter division model of lens distortion (paper, equation (2)).

``x_u = x_d / (1 + lambda r_d^2)`` with the origin at the distortion centre.  Lambda is normalised
throughout: ``r_d = 1`` at half the image's diagonal, which is the distance of the image's corners
from its centre.  Barrel distortion (wide-angle, fisheye) has lambda < 0, pincushion distortion
lambda > 0.  Pixels are assumed to be square.

Reference: A. W. Fitzgibbon, Simultaneous linear estimation of multiple view geometry and lens
distortion, CVPR 2001.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qflsd_ros.core.arcs import Arcs

# Points along an arc from which its straight segment is fitted.  An undistorted arc of a straight
# edge is straight, so that more points would not change the fit.
SAMPLES = 9


@dataclass(frozen=True)
class DivisionModel:
    """
    The lens of an image: its distortion by the division model.

    Attributes
    ----------
    lam
        Lambda, normalised to half the image's diagonal; 0 is a lens without distortion.
    shape
        (height, width) of the image, px.
    centre
        Distortion centre (x, y) in px, with (0, 0) at the centre of the top-left pixel; None
        stands for the image centre ``((W - 1) / 2, (H - 1) / 2)``.

    """

    lam: float
    shape: tuple[int, int]
    centre: tuple[float, float] | None = None

    @property
    def half_diagonal(self) -> float:
        """Half the image's diagonal in px, the unit of length of lambda."""
        return float(np.hypot(*self.shape)) / 2

    @property
    def origin(self) -> np.ndarray:
        """Distortion centre x, y in px: (2,) float64."""
        height, width = self.shape
        return np.array(self.centre if self.centre is not None
                        else ((width - 1) / 2, (height - 1) / 2), float)

    @property
    def in_pixels(self) -> tuple[float, float, float]:
        """Lambda in 1 / px^2, and the distortion centre x, y in px."""
        x, y = self.origin.tolist()
        return self.lam / self.half_diagonal ** 2, x, y

    def reduced(self, factor: int) -> DivisionModel:
        """
        Return the lens of the image reduced by an integer factor.

        A pixel of the reduced image covers a block of factor x factor pixels.  Blocks begin
        at (0, 0), as in :meth:`Arcs.scaled`; rows and columns at the end that do not fill a block
        are dropped, and lambda is converted to the shorter diagonal.
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
        Map image points to the undistorted image (paper, equation (2)).

        The undistorted image has the same distortion centre, and the same scale there.

        Parameters
        ----------
        points
            (..., 2) px.

        Returns
        -------
        undistorted
            (..., 2) float64 px; nan from the radius 1 / sqrt(|lambda|) on, where a barrel looks
            at right angles to the optical axis, and a pincushion folds the image over.

        """
        q = (np.asarray(points, float) - self.origin) / self.half_diagonal
        bend = self.lam * (q ** 2).sum(axis=-1, keepdims=True)
        with np.errstate(divide='ignore', invalid='ignore'):
            undistorted = q / (1 + bend) * self.half_diagonal + self.origin
        return np.where(np.abs(bend) < 1, undistorted, np.nan)

    def distort(self, points: np.ndarray) -> np.ndarray:
        """
        Map points of the undistorted image to this image: the exact inverse of `undistort`.

        Parameters
        ----------
        points
            (..., 2) px.

        Returns
        -------
        distorted
            (..., 2) float64 px; nan for points that this lens does not show (lambda > 0, and the
            radius above 1 / sqrt(4 lambda)).

        """
        q = (np.asarray(points, float) - self.origin) / self.half_diagonal
        r2 = (q ** 2).sum(axis=-1, keepdims=True)
        with np.errstate(invalid='ignore'):
            root = np.sqrt(1 - 4 * self.lam * r2)
        return 2 * q / (1 + root) * self.half_diagonal + self.origin

    def curvature(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """
        Return the curvature of the images of straight edges.

        By equation (4) of the paper, the line ``B x + C y + D = 0`` of the undistorted image is
        the circle ``lambda D (x^2 + y^2) + B x + C y + D = 0`` of this image.

        Parameters
        ----------
        points
            (..., 2) px, points of this image on the edges.
        normals
            (..., 2), unit normals of the images of the edges at these points.

        Returns
        -------
        curvature
            (...) float64 1/px, positive where the image of an edge bends away from its normal.

        """
        q = (np.asarray(points, float) - self.origin) / self.half_diagonal
        across = (q * normals).sum(axis=-1)
        return -2 * self.lam * across / (1 - self.lam * (q ** 2).sum(axis=-1)) / self.half_diagonal


def rectified(arcs: Arcs, lens: DivisionModel) -> np.ndarray:
    """
    Return arcs as straight segments of the undistorted image.

    Parameters
    ----------
    arcs
        The arcs of an image; each is assumed to be the image of a straight edge.
    lens
        The lens of that image.

    Returns
    -------
    segments
        (M, 2, 2) float64 px of the undistorted image, which has the same scale as the image at
        the distortion centre: start and end (x, y) of each arc, projected onto the straight line
        of least squares through its undistorted points.  nan for an arc with a point that
        :meth:`DivisionModel.undistort` cannot map.

    """
    points = lens.undistort(arcs.samples(SAMPLES))
    middle = points.mean(axis=1)
    off = points - middle[:, None]
    (xx, yy), xy = (off ** 2).sum(axis=1).T, (off[..., 0] * off[..., 1]).sum(axis=1)
    angle = np.arctan2(2 * xy, xx - yy) / 2     # centre and direction of the line of least squares
    along = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None]
    ends = off[:, [0, -1]]
    return middle[:, None] + (ends * along).sum(axis=-1, keepdims=True) * along
