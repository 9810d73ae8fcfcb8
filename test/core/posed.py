"""Straight edges in space, and their planes as posed cameras see them."""
from __future__ import annotations

import numpy as np
from qflsd_ros.core.geometry.planes import Planes
from qflsd_ros.core.pose import Pose


def edges(count: int, seed: int = 0) -> np.ndarray:
    """Return starts and ends of edges in front of the origin: (count, 2, 3) m."""
    random = np.random.default_rng(seed)
    middle = random.uniform((-1.5, -1, 2.5), (1.5, 1, 5), (count, 3))
    half = random.normal(size=(count, 3))
    half *= random.uniform(0.2, 0.5, (count, 1)) / np.linalg.norm(half, axis=1, keepdims=True)
    return np.stack([middle - half, middle + half], axis=1)


def turned(random: np.random.Generator, angle: float) -> np.ndarray:
    """Return a rotation about any axis by an angle, radians: (3, 3)."""
    axis = random.normal(size=3)
    axis /= np.linalg.norm(axis)
    return Pose.from_quaternion(np.r_[np.sin(angle / 2) * axis, np.cos(angle / 2)],
                                np.zeros(3)).rotation


def poses(count: int, seed: int = 0, way: tuple[float, float, float] = (0.6, 0.4, 0.2)
          ) -> list[Pose]:
    """Return the poses of a camera that moves along ``way``, m, in a bow, and turns a little."""
    random = np.random.default_rng((seed, 1))
    share = np.linspace(-0.5, 0.5, count)
    bow = 0.3 * float(np.linalg.norm(way)) * share ** 2
    return [Pose(turned(random, 0.05), s * np.array(way) + (0, b, 0))
            for s, b in zip(share, bow)]


def sight(lines: np.ndarray, pose: Pose, noise: float = 0.0,
          random: np.random.Generator | None = None) -> Planes:
    """
    Return the planes of edges, (N, 2, 3), in a camera.

    Each normal deviates by ``noise`` times (1, 2), along the middle ray and across it; its
    covariance states that, and 1e-12 more.
    """
    local = (lines - pose.centre) @ pose.rotation
    rays = local / np.linalg.norm(local, axis=2, keepdims=True)
    normals = np.cross(rays[:, 0], rays[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    middle = rays.sum(axis=1) / np.linalg.norm(rays.sum(axis=1), axis=1, keepdims=True)
    sides = np.stack([middle, np.cross(normals, middle)], axis=1)
    spread = noise * np.array([1, 2.0])
    covariances = np.einsum('nki,k,nkj->nij', sides, spread ** 2 + 1e-12, sides)
    if random is not None:
        errors = random.normal(size=(len(lines), 2)) * spread
        normals = normals + np.einsum('nk,nki->ni', errors, sides)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Planes(np.arange(len(lines)), normals, covariances, rays)
