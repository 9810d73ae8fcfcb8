"""The camera of the synthetic scene: viewing directions of pixels, and projection of points."""
from __future__ import annotations

from dataclasses import dataclass
from math import hypot, nan, sqrt

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.lens.conversion import calibration_terms, CameraInfoTerms
from qflsd_ros.core.lens.division import DivisionModel

# Focal length, half diagonals: 96 degrees over the diagonal without distortion, so that the camera
# sees most of a wall from within the room.
FOCAL = 0.9
MARGIN = 2.0    # px about a sample of an edge: half the longest step, 3 px, and some for rounding

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Camera:
    """
    A camera at a place in the world.

    By the division model a pixel looks in the direction ``(x_d, y_d, focal (1 + lambda r_d^2))``
    of the camera's axes, which also holds beyond 90 degrees from the optical axis.
    """

    lens: DivisionModel
    position: np.ndarray    # (3,) m
    axes: np.ndarray        # (3, 3): the image's x axis, its y axis, the optical axis as rows

    def pose(self) -> np.ndarray:
        """Return the matrix that maps points of the camera's axes to the world: (4, 4), m."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.axes.T, self.position
        return matrix

    def numbers(self) -> tuple[float, ...]:
        """
        Return the camera as the kernels take it.

        These are the distortion centre (2, px), the reciprocal of half the diagonal, FOCAL, lambda
        and the axes (9).
        """
        return (*map(float, self.lens.origin), 1 / self.lens.half_diagonal, FOCAL, self.lens.lam,
                *map(float, self.axes.ravel()))

    def rays(self, points: np.ndarray) -> np.ndarray:
        """Return the viewing directions of image points, (..., 2) px, in the world: (..., 3)."""
        q = (np.asarray(points, float) - self.lens.origin) / self.lens.half_diagonal
        depth = FOCAL * (1 + self.lens.lam * (q ** 2).sum(axis=-1, keepdims=True))
        return np.concatenate([q, depth], axis=-1) @ self.axes

    def project(self, points: np.ndarray) -> np.ndarray:
        """Project points of the world, (..., 3) m: (..., 2) px, nan for points without image."""
        local = (points - self.position) @ self.axes.T
        side, depth = local[..., :2], local[..., 2:] / FOCAL
        with np.errstate(invalid='ignore', divide='ignore'):
            square = (side ** 2).sum(axis=-1, keepdims=True)
            root = np.sqrt(depth ** 2 - 4 * self.lens.lam * square)
            q = np.where(depth + root > 0, 2 * side / (depth + root), np.nan)
        return q * self.lens.half_diagonal + self.lens.origin


def calibration(lens: DivisionModel) -> CameraInfoTerms:
    """Return the lens of the scene in the terms of CameraInfo, with its true focal length."""
    return calibration_terms(lens, FOCAL * lens.half_diagonal)


def angles_per_pixel(lens: DivisionModel) -> tuple[float, float]:
    """Return the smallest and the largest angle, radians, between directions 1 px apart."""
    r = np.linspace(1e-3, 1, 200)   # the angles change slowly with the radius
    depth = FOCAL * (1 + lens.lam * r ** 2)
    radial = FOCAL * (1 - lens.lam * r ** 2) / (r ** 2 + depth ** 2)
    tangential = 1 / np.hypot(r, depth)
    both = np.concatenate([radial, tangential]) / lens.half_diagonal
    return float(both.min()), float(both.max())


@inlined
def ray(camera: tuple[float, ...], x: float, y: float) -> Point:
    """Return the viewing direction of the image point x, y (px) in the world."""
    x0, y0, scale, focal, lam, ax, ay, az, bx, by, bz, cx, cy, cz = camera
    u, v = (x - x0) * scale, (y - y0) * scale
    w = focal * (1 + lam * (u * u + v * v))
    # The offset prevents a division by 0 for rays that are parallel to a face.
    return (u * ax + v * bx + w * cx + 1e-12, u * ay + v * by + w * cy + 1e-12,
            u * az + v * bz + w * cz + 1e-12)


@inlined
def project(camera: tuple[float, ...], px: float, py: float, pz: float) -> tuple[float, float]:
    """Project a point, given relative to the camera in the world's axes (m): x, y px, or nan."""
    x0, y0, scale, focal, lam, ax, ay, az, bx, by, bz, cx, cy, cz = camera
    x, y = px * ax + py * ay + pz * az, px * bx + py * by + pz * bz
    depth = (px * cx + py * cy + pz * cz) / focal
    square = depth * depth - 4 * lam * (x * x + y * y)
    if square < 0 or depth + sqrt(square) <= 0:
        return nan, nan
    stretch = 2 / ((depth + sqrt(square)) * scale)
    return x0 + x * stretch, y0 + y * stretch


@compiled
def near_edges(camera: tuple[float, ...], eye: Point, lines: np.ndarray, step: float, size: int,
               busy: np.ndarray) -> None:
    """
    Mark the blocks of an image that an edge may cross.

    Parameters
    ----------
    camera, eye
        :meth:`Camera.numbers`, and the camera's position, m.
    lines
        (N, 2, 3) m, starts and ends of edges, hidden ones included.
    step
        Distance of samples along an edge as an angle, radians; at most 3 px in the image.
    size
        Side of a block, px.
    busy
        (rows, columns) bool, a value for each block: set if an edge may cross it.

    """
    rows, columns = busy.shape
    for i in range(len(lines)):
        sx, sy, sz = lines[i, 0, 0], lines[i, 0, 1], lines[i, 0, 2]
        px, py, pz = sx - eye[0], sy - eye[1], sz - eye[2]
        ex, ey, ez = lines[i, 1, 0] - sx, lines[i, 1, 1] - sy, lines[i, 1, 2] - sz
        length, share = sqrt(ex * ex + ey * ey + ez * ez), 0.0
        while share < 1:
            qx, qy, qz = px + share * ex, py + share * ey, pz + share * ez
            x, y = project(camera, qx, qy, qz)
            if -1 < x < columns * size and -1 < y < rows * size:
                left, right = max(int(x - MARGIN), 0) // size, int(x + MARGIN + 1) // size
                over, below = max(int(y - MARGIN), 0) // size, int(y + MARGIN + 1) // size
                for row in range(over, min(below + 1, rows)):
                    for column in range(left, min(right + 1, columns)):
                        busy[row, column] = True
            share += step * hypot(hypot(qx, qy), qz) / length
