"""Where a camera is, and where it looks."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

PARALLEL = 1e-9     # 1 - cosine below which two quaternions count as the same: far below any use


class Pose(NamedTuple):
    """
    The pose of an optical frame (x right, y down, z forward) in the world.

    A point p of the optical frame is ``rotation @ p + centre`` in the world.
    """

    rotation: np.ndarray    # (3, 3) float64
    centre: np.ndarray      # (3,) float64, the optical centre

    @classmethod
    def from_quaternion(cls, quaternion: np.ndarray, centre: np.ndarray) -> Pose:
        """
        Return the pose of a unit quaternion (x, y, z, w) and a centre, (3,).

        Raises
        ------
        ValueError
            The numbers are not finite, or the quaternion is 0.

        """
        size = np.linalg.norm(quaternion)
        if not (np.isfinite(quaternion).all() and np.isfinite(centre).all() and size > 0):
            raise ValueError(
                f'quaternion {quaternion.tolist()} and position {centre.tolist()} are no pose: '
                'numbers must be finite, the quaternion not 0')
        x, y, z, w = quaternion / size
        rotation = np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        return cls(rotation, np.asarray(centre, float))

    @classmethod
    def from_matrix(cls, matrix: np.ndarray) -> Pose:
        """Return the pose of a (4, 4) matrix that maps the optical frame to the world."""
        return cls(matrix[:3, :3], matrix[:3, 3])

    def relative_to(self, other: Pose) -> Pose:
        """Return this pose in the optical frame of another one."""
        return Pose(other.rotation.T @ self.rotation,
                    other.rotation.T @ (self.centre - other.centre))


def between(one: np.ndarray, two: np.ndarray, share: float) -> np.ndarray:
    """
    Return the unit quaternion at a share of the way from one to another (slerp).

    Reference: K. Shoemake, Animating rotation with quaternion curves, SIGGRAPH 1985.
    """
    cosine = float(one @ two)
    two, cosine = (two, cosine) if cosine >= 0 else (-two, -cosine)
    if 1 - cosine < PARALLEL:
        mixed = (1 - share) * one + share * two
    else:
        angle = np.arccos(cosine)
        mixed = np.sin((1 - share) * angle) * one + np.sin(share * angle) * two
    return mixed / np.linalg.norm(mixed)
