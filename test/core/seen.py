"""Arcs that need no image: pictures of straight edges, and circles, with noisy edge points."""
from __future__ import annotations

from typing import Sequence

import numpy as np
from qflsd_ros.core import Arcs, DivisionModel
from qflsd_ros.core.arcs import TABLE

STEP = 1.0          # px between edge points
CORRELATED = 3      # neighbouring edge points that err together


def edge(lens: DivisionModel, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return points along the picture of a straight edge between two image points, (N, 2) px."""
    ends = lens.undistort(np.array([start, end]))
    share = np.linspace(0, 1, max(9, round(np.hypot(*np.subtract(end, start)) / STEP)))[:, None]
    return lens.distort(ends[0] + share * (ends[1] - ends[0]))


def edges(lens: DivisionModel, count: int, seed: int, length: tuple[float, float] = (60, 200)
          ) -> list[np.ndarray]:
    """Return pictures of edges all over the image, their lengths in px between two bounds."""
    random = np.random.default_rng(seed)
    size, found = np.array(lens.shape[::-1]) - 1, []
    while len(found) < count:
        start, angle = random.uniform(0, size), random.uniform(0, 2 * np.pi)
        end = start + random.uniform(*length) * np.array([np.cos(angle), np.sin(angle)])
        shown = np.isfinite(lens.undistort(np.array([start, end]))).all()
        if shown and (end > 0).all() and (end < size).all():
            found.append(edge(lens, start, end))
    return found


def wheels(lens: DivisionModel, count: int, seed: int) -> list[np.ndarray]:
    """Return halves of circles of radii from 20 to 60 px, anywhere in the image."""
    random = np.random.default_rng(seed)
    half = np.linspace(0, np.pi, 80)
    return [random.uniform(60, np.array(lens.shape[::-1]) - 60)
            + random.uniform(20, 60) * np.stack([np.cos(half + turn), np.sin(half + turn)], 1)
            for turn in random.uniform(0, 2 * np.pi, count)]


def arcs_of(curves: Sequence[np.ndarray], noise: float = 0.05, seed: int = 0) -> Arcs:
    """Return arcs along curves, their edge points off by ``noise`` px."""
    random, table = np.random.default_rng(seed), np.zeros(len(curves), TABLE)
    points = []
    for row, curve in zip(table, curves):
        one, two = curve[len(curve) // 2] - curve[0], curve[-1] - curve[len(curve) // 2]
        size = np.hypot(*(one + two))
        bend = 2 * (one[0] * two[1] - one[1] * two[0]) / np.hypot(*one) / np.hypot(*two) / size
        half = np.arcsin(np.clip(bend * size / 2, -1, 1))
        row['start'], row['middle'], row['end'] = curve[0], curve[len(curve) // 2], curve[-1]
        row['curvature'], row['length'] = bend, size * half / np.sin(half) if half else size
        errors = random.normal(0, noise, (len(curve) // CORRELATED + 1, 2))
        points.append(curve + np.repeat(errors, CORRELATED, axis=0)[:len(curve)])
    offsets = np.cumsum([0, *map(len, points)])
    flat = np.concatenate([np.zeros((0, 2)), *points])
    return Arcs(table, flat, np.rint(flat).astype(np.int32), offsets)
