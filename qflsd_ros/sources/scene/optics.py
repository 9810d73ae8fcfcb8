"""The camera of the synthetic scene: which way each pixel looks, and where a point is seen."""
from __future__ import annotations

from dataclasses import dataclass
from math import hypot, nan, sqrt

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.lens.division import DivisionModel

FOCAL = 0.9     # half diagonals
MARGIN = 2.0    # px


@dataclass(frozen=True)
class Camera:
    """
    A lens at a place in the world.

    The division model is taken as the direction ``(x_d, y_d, focal (1 + lambda r_d^2))`` that a
    pixel looks in, which holds beyond 90 degrees from the optical axis as well.
    """

    lens: DivisionModel
    position: np.ndarray    # (3,) m
    axes: np.ndarray        # (3, 3): the image's x axis, its y axis, the optical axis as rows

    def numbers(self) -> tuple[float, ...]:
        """Return all that the compiled functions need to know."""
        return (*map(float, self.lens.origin), 1 / self.lens.half_diagonal, FOCAL, self.lens.lam,
                *map(float, self.axes.ravel()))

    def rays(self, points: np.ndarray) -> np.ndarray:
        """Return the directions in the world that are seen at (..., 2) px; (..., 3)."""
        q = (np.asarray(points, float) - self.lens.origin) / self.lens.half_diagonal
        depth = FOCAL * (1 + self.lens.lam * (q ** 2).sum(axis=-1, keepdims=True))
        return np.concatenate([q, depth], axis=-1) @ self.axes

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return where points of the world, (..., 3) m, are seen; (..., 2) px, nan if nowhere."""
        local = (points - self.position) @ self.axes.T
        side, depth = local[..., :2], local[..., 2:] / FOCAL
        with np.errstate(invalid='ignore', divide='ignore'):
            square = (side ** 2).sum(axis=-1, keepdims=True)
            root = np.sqrt(depth ** 2 - 4 * self.lens.lam * square)
            q = np.where(depth + root > 0, 2 * side / (depth + root), np.nan)
        return q * self.lens.half_diagonal + self.lens.origin


def angles_per_pixel(lens: DivisionModel) -> tuple[float, float]:
    """Return the smallest and the largest angle in radians that a step of 1 px makes."""
    r = np.linspace(1e-3, 1, 200)
    depth = FOCAL * (1 + lens.lam * r ** 2)
    radial = FOCAL * (1 - lens.lam * r ** 2) / (r ** 2 + depth ** 2)
    tangential = 1 / np.hypot(r, depth)
    both = np.concatenate([radial, tangential]) / lens.half_diagonal
    return float(both.min()), float(both.max())


@inlined
def ray(camera, x, y):
    """Return the direction in the world that is seen at x, y px."""
    x0, y0, scale, focal, lam, ax, ay, az, bx, by, bz, cx, cy, cz = camera
    u, v = (x - x0) * scale, (y - y0) * scale
    w = focal * (1 + lam * (u * u + v * v))
    # What lies exactly in a face would divide by 0.
    return (u * ax + v * bx + w * cx + 1e-12, u * ay + v * by + w * cy + 1e-12,
            u * az + v * bz + w * cz + 1e-12)


@inlined
def project(camera, px, py, pz):
    """Return where a point is seen, given relative to the camera in the world's axes; px."""
    x0, y0, scale, focal, lam, ax, ay, az, bx, by, bz, cx, cy, cz = camera
    x, y = px * ax + py * ay + pz * az, px * bx + py * by + pz * bz
    depth = (px * cx + py * cy + pz * cz) / focal
    square = depth * depth - 4 * lam * (x * x + y * y)
    if square < 0 or depth + sqrt(square) <= 0:
        return nan, nan
    stretch = 2 / ((depth + sqrt(square)) * scale)
    return x0 + x * stretch, y0 + y * stretch


@compiled
def near_edges(camera, eye, lines, step, size, busy):
    """
    Mark which blocks of an image an edge may cross.

    Parameters
    ----------
    camera, eye
        The camera's numbers and its position, three floats, m.
    lines
        (N, 2, 3) m, starts and ends of edges; hidden ones count as well.
    step
        Angle in radians that is at most 3 px.
    size
        Blocks are size x size px.
    busy
        (rows, columns) bool, a value for each block, set where an edge may cross it.

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
