"""An equidistant fisheye, to stand beside the division model: its lines are not quite circles."""
from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Protocol

import numpy as np


class Lens(Protocol):
    """What a scene needs to know of a lens; :class:`qflsd_ros.core.DivisionModel` is one."""

    shape: tuple[int, int]

    @property
    def origin(self) -> np.ndarray:
        """Return the centre of distortion x, y in px."""

    def undistort(self, points: np.ndarray) -> np.ndarray:
        """Map image points to where a lens without distortion shows them; (..., 2) px."""

    def distort(self, points: np.ndarray) -> np.ndarray:
        """Map points of an image without distortion to where this lens shows them."""


@dataclass(frozen=True)
class EquidistantLens:
    """
    A lens whose image radius is proportional to the angle from its axis, r = f theta.

    ``field`` is the angle in degrees between opposite corners of an image of (height, width),
    below 180: beyond 90 degrees from the axis there is no plane image.
    """

    field: float
    shape: tuple[int, int]

    @property
    def focal(self) -> float:
        """Return the focal length in px: of this lens, and of the one without distortion."""
        return math.hypot(*self.shape) / 2 / math.radians(self.field / 2)

    @property
    def origin(self) -> np.ndarray:
        """Return the centre of the image x, y in px."""
        height, width = self.shape
        return np.array([(width - 1) / 2, (height - 1) / 2])

    def undistort(self, points: np.ndarray) -> np.ndarray:
        """Map image points to where a lens without distortion shows them; (..., 2) px."""
        return self._scaled(points, lambda r: np.tan(r))

    def distort(self, points: np.ndarray) -> np.ndarray:
        """Map points of an image without distortion to where this lens shows them."""
        return self._scaled(points, lambda r: np.arctan(r))

    def _scaled(self, points: np.ndarray, radius) -> np.ndarray:
        q = (np.asarray(points, float) - self.origin) / self.focal
        r = np.maximum(np.hypot(q[..., 0], q[..., 1]), 1e-12)
        return q * (radius(r) / r)[..., None] * self.focal + self.origin
