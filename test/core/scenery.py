"""Images of scenes and of noise, for what holds for all images."""
from __future__ import annotations

import functools

import cv2
import numpy as np
from qflsd_ros.core import DivisionModel
from rendering import disk, polygon, render, through_lens


@functools.cache
def scene(seed: int = 0, shape: tuple[int, int] = (180, 240)) -> np.ndarray:
    """Return an image of straight edges behind a lens, a round edge, and noise."""
    random = np.random.default_rng(seed)
    height, width = shape
    lens = DivisionModel(-0.4, shape)
    gray = render(shape, disk(0.4 * width, 2.1 * height, 1.4 * height), 90, 150).astype(float)
    for _ in range(4):
        x, y = random.uniform(0.1, 0.7, 2) * (width, height)
        w, h = random.uniform(0.2, 0.5, 2) * (width, height)
        angle, level = random.uniform(0, 0.6), random.uniform(-60, 60)
        u, v = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        corners = [tuple(np.array([x, y]) + p) for p in (0 * u, w * u, w * u + h * v, h * v)]
        gray += render(shape, through_lens(polygon(corners), lens), 0, 100) / 100 * level
    gray = np.clip(np.round(gray + random.normal(0, 2, shape)), 0, 255).astype(np.uint8)
    gray.flags.writeable = False
    return gray


def noise(seed: int, shape: tuple[int, int]) -> np.ndarray:
    """Return noise of every grain, from single pixels to areas."""
    random = np.random.default_rng(seed)
    gray = random.normal(0, 1, shape)
    for grain in (2.0, 5.0, 12.0):
        gray += 2 * grain * cv2.GaussianBlur(random.normal(0, 1, shape), (0, 0), grain)
    return np.clip(128 + 40 * gray, 0, 255).astype(np.uint8)
