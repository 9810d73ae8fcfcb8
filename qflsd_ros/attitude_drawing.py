"""Drawing of an attitude on its image: the horizon, and the three axes of the place."""
from __future__ import annotations

import cv2
import numpy as np

from qflsd_ros.core.attitude.estimation import Attitude
from qflsd_ros.overlay import DIRECTIONS, SUBPIXEL_BITS

# All of these are chosen, not tuned.
STEP = 8            # px between the points at which the horizon is sought; it bends little between
ARROW = 0.2         # length of an axis at right angles to the view, of the shorter side
HORIZON = (0, 255, 255)     # B, G, R: yellow, which few places show


def draw_attitude(picture: np.ndarray, attitude: Attitude, line_width: int = 1) -> None:
    """
    Draw horizon and axes on an image.

    Parameters
    ----------
    picture
        (H, W, 3) uint8 B, G, R, which is changed.
    attitude
        The attitude of the image; without ``up``, only axes are drawn.
    line_width
        Width of the arcs of the image in px; horizon and axes are 1 px wider.

    """
    if attitude.up is not None:
        lines = np.rint(horizon(attitude, picture.shape[:2]) * (1 << SUBPIXEL_BITS))
        cv2.polylines(picture, list(lines.astype(np.int32)), False, HORIZON, line_width + 1,
                      cv2.LINE_AA, SUBPIXEL_BITS)
    start, ends = axes(attitude, picture.shape[:2])
    for end, colour in zip(ends, DIRECTIONS.tolist()):
        cv2.arrowedLine(picture, _pixel(start), _pixel(end), colour, line_width + 1, cv2.LINE_AA)


def horizon(attitude: Attitude, shape: tuple[int, int]) -> np.ndarray:
    """
    Return the image of the horizon as short pieces: (N, 2, 2) px, in no order.

    It is where the viewing directions are at right angles to up, found between the points of a
    grid by linear interpolation.
    """
    height, width = shape
    x, y = (np.arange(0.0, size - 1 + STEP, STEP) for size in (width, height))
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    above = attitude.rays(grid) @ attitude.directions[0]
    across, down = (_crossings(grid, above, axis) for axis in (1, 0))
    sides = np.stack([across[:-1], across[1:], down[:, :-1], down[:, 1:]], axis=2)
    sides = sides.reshape(-1, 4, 2)
    crossed = np.isfinite(sides).all(axis=2)
    twice = np.count_nonzero(crossed, axis=1) == 2
    return sides[twice][crossed[twice]].reshape(-1, 2, 2)


def _crossings(grid: np.ndarray, above: np.ndarray, axis: int) -> np.ndarray:
    """Return where the height passes 0 between neighbours along an axis, nan elsewhere."""
    first = [slice(None), slice(None)]
    second = first.copy()
    first[axis], second[axis] = slice(None, -1), slice(1, None)
    a, b = above[tuple(first)], above[tuple(second)]
    with np.errstate(divide='ignore', invalid='ignore'):
        share = np.where((a < 0) != (b < 0), a / (a - b), np.nan)[..., None]
    return grid[tuple(first)] * (1 - share) + grid[tuple(second)] * share


def axes(attitude: Attitude, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the axes as arrows from the middle of the image: their start, (2,), and ends, (3, 2) px.

    An axis at right angles to the view is ARROW long, one along it has no length.
    """
    middle = (np.array(shape[::-1]) - 1) / 2
    ray, right, below = attitude.rays(middle + np.array([[0, 0], [1, 0], [0, 1]]))
    slope = np.stack([right - ray, below - ray], axis=1)        # of the ray, per px
    across = attitude.directions[:3] - (attitude.directions[:3] @ ray)[:, None] * ray
    steps = across @ np.linalg.pinv(slope).T
    radius = np.sqrt(np.abs(np.linalg.det(slope.T @ slope)))    # solid angle of a pixel
    return middle, middle + steps * ARROW * min(shape) * np.sqrt(radius)


def _pixel(point: np.ndarray) -> tuple[int, int]:
    x, y = np.rint(point).astype(int).tolist()
    return x, y
