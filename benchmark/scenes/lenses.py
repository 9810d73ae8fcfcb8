"""
Lenses of rendered scenes: the interface, and an equidistant fisheye.

Through an equidistant lens the image of a straight line is not exactly a circle, which tests the
detector beyond the division model.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math
from typing import Protocol

import numpy as np


class Lens(Protocol):
    """The interface of a lens model; :class:`qflsd_ros.core.DivisionModel` has it."""

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the image in px."""

    @property
    def origin(self) -> np.ndarray:
        """Centre of distortion x, y in px."""

    def undistort(self, points: np.ndarray) -> np.ndarray:
        """Map points (..., 2) px of the image to an image without distortion."""

    def distort(self, points: np.ndarray) -> np.ndarray:
        """Map points (..., 2) px of an image without distortion to this lens's image."""


@dataclass(frozen=True)
class EquidistantLens:
    """
    A lens whose image radius is proportional to the angle from its axis, r = f theta.

    ``field`` is the angle in degrees between opposite corners of an image of (height, width),
    below 180: an image without distortion ends at 90 degrees from the axis.
    """

    field: float
    shape: tuple[int, int]

    @property
    def focal(self) -> float:
        """Focal length in px, of this lens and of the image without distortion."""
        return math.hypot(*self.shape) / 2 / math.radians(self.field / 2)

    @property
    def origin(self) -> np.ndarray:
        """Centre of the image x, y in px."""
        height, width = self.shape
        return np.array([(width - 1) / 2, (height - 1) / 2])

    def undistort(self, points: np.ndarray) -> np.ndarray:
        """Map points (..., 2) px of the image to an image without distortion."""
        return self._scaled(points, np.tan)

    def distort(self, points: np.ndarray) -> np.ndarray:
        """Map points (..., 2) px of an image without distortion to this lens's image."""
        return self._scaled(points, np.arctan)

    def _scaled(self, points: np.ndarray,
                radius: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        q = (np.asarray(points, float) - self.origin) / self.focal
        r = np.maximum(np.hypot(q[..., 0], q[..., 1]), 1e-12)
        return q * (radius(r) / r)[..., None] * self.focal + self.origin
