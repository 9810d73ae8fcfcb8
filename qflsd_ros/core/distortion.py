"""
The one-parameter division model of lens distortion (paper, equation (2)).

``x_u = x_d / (1 + lambda r_d^2)`` with the origin at the distortion centre.  Lambda is normalised
throughout: ``r_d = 1`` at half the image's diagonal, which is the corner of the image when the
centre is the image's own.  A barrel (wide-angle, fisheye) has lambda < 0.

Reference: A. W. Fitzgibbon, Simultaneous linear estimation of multiple view geometry and lens
distortion, CVPR 2001.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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

    def undistort(self, points: np.ndarray) -> np.ndarray:
        """Map image points to where a lens without distortion shows them; (..., 2) px."""
        q = (np.asarray(points, float) - self.origin) / self.half_diagonal
        r2 = (q ** 2).sum(axis=-1, keepdims=True)
        return q / (1 + self.lam * r2) * self.half_diagonal + self.origin

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
