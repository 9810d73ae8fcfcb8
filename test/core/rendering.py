"""
Images whose edges are known exactly.

A region is a function of x and y, in px, that gives the signed distance from its edge, positive
inside: unions are ``np.maximum`` of regions, intersections ``np.minimum``.
"""
from __future__ import annotations

from typing import Callable, Sequence

import cv2
import numpy as np
from qflsd_ros.core import DivisionModel

Region = Callable[[np.ndarray, np.ndarray], np.ndarray]
SAMPLES = 4         # along each side of a pixel; each is a ramp of its own, so few suffice
AROUND = np.ones((3, 3))
LOW, HIGH = 60.0, 180.0


def disk(x: float, y: float, radius: float) -> Region:
    return lambda u, v: radius - np.hypot(u - x, v - y)


def half_plane(x: float, y: float, angle: float) -> Region:
    """Return what lies to the right of travel through (x, y) at an angle in radians."""
    return lambda u, v: (v - y) * np.cos(angle) - (u - x) * np.sin(angle)


def polygon(corners: Sequence[tuple[float, float]]) -> Region:
    """Return a convex polygon, its corners clockwise as one sees the image."""
    sides = [half_plane(x, y, np.arctan2(to_y - y, to_x - x))
             for (x, y), (to_x, to_y) in zip(corners, [*corners[1:], corners[0]])]
    return lambda u, v: np.min(np.broadcast_arrays(*(side(u, v) for side in sides)), axis=0)


def both(one: Region, other: Region) -> Region:
    return lambda u, v: np.minimum(one(u, v), other(u, v))


def through_lens(region: Region, lens: DivisionModel) -> Region:
    """Return the picture that a lens gives of a region; distances in the undistorted image."""
    def picture(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        points = lens.undistort(np.stack(np.broadcast_arrays(u, v), axis=-1))
        return region(points[..., 0], points[..., 1])
    return picture


def render(shape: tuple[int, int], region: Region, low: float = LOW, high: float = HIGH,
           blur: float = 0.0, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Return the (H, W) uint8 image of a region: ``high`` inside, each pixel its area's mean."""
    grey = low + (high - low) * cover(shape, region)
    if blur > 0:
        grey = cv2.GaussianBlur(grey, (0, 0), blur, borderType=cv2.BORDER_REPLICATE)
    if noise > 0:
        grey = grey + np.random.default_rng(seed).normal(0, noise, shape)
    return np.clip(np.round(grey), 0, 255).astype(np.uint8)


def cover(shape: tuple[int, int], region: Region) -> np.ndarray:
    """Return which share of each pixel lies in a region, (H, W); sampled near its edge alone."""
    y, x = (np.arange(size, dtype=float) for size in shape)
    depth = np.broadcast_to(region(x[None, :], y[:, None]), shape)
    # A pixel that the edge crosses is no deeper than the depth changes from it to its neighbours.
    change = cv2.dilate(depth, AROUND) - cv2.erode(depth, AROUND)
    rows, columns = np.nonzero(np.abs(depth) < change + 1 / SAMPLES)
    offsets = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    found = np.where(depth > 0, 1.0, 0.0)
    samples = 0.5 + SAMPLES * region(columns[:, None, None] + offsets,
                                     rows[:, None, None] + offsets[:, None])
    found[rows, columns] = np.clip(samples, 0, 1).mean(axis=(1, 2))
    return found


def off_circle(points: np.ndarray, x: float, y: float, radius: float) -> np.ndarray:
    """Return the signed distances of (..., 2) points from a circle, px."""
    return np.hypot(points[..., 0] - x, points[..., 1] - y) - radius


def off_line(points: np.ndarray, x: float, y: float, angle: float) -> np.ndarray:
    """Return the signed distances of (..., 2) points from a line, px."""
    return half_plane(x, y, angle)(points[..., 0], points[..., 1])
