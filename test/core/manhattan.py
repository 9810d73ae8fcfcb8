"""Arcs of a place whose edges have three orthogonal directions, seen by a known camera."""
from __future__ import annotations

from dataclasses import replace

import numpy as np
from qflsd_ros.core import Arcs, DivisionModel
from seen import arcs_of, edge

SHAPE = (480, 640)
UP = np.array([0.0, -1.0, 0.0])


def turned(yaw: float, pitch: float, roll: float) -> np.ndarray:
    """Return axes of the place in the optical frame, rows: east, down, north; from radians."""
    cy, sy, cp, sp, cr, sr = (f(a) for a in (yaw, pitch, roll) for f in (np.cos, np.sin))
    return (np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
            @ np.array([[1, 0, 0], [0, cp, sp], [0, -sp, cp]])
            @ np.array([[cr, sr, 0], [-sr, cr, 0], [0, 0, 1]]))


def pieces(axes: np.ndarray, focal: float, lens: DivisionModel, counts: tuple[int, ...],
           random: np.random.Generator) -> list[np.ndarray]:
    """Return images of edges, ``counts[k]`` of them along axis k, 40 to 160 px long."""
    size, found = np.array(lens.shape[::-1]) - 1.0, []
    for axis, count in zip(axes, counts):
        left = count
        while left:
            start = random.uniform(0, size)
            ray = np.append(lens.undistort(start) - lens.origin, focal)
            # Of the straight edge, a second point in the undistorted image, and from there the
            # direction in this one.
            near = ray + 1e-4 * focal * axis
            step = lens.distort(lens.origin + focal * near[:2] / near[2]) - start
            end = start + step / np.hypot(*step) * random.uniform(40, 160)
            line = _to(ray, axis, focal, lens, end)
            if line is not None and (line > 0).all() and (line < size).all():
                found.append(line)
                left -= 1
    return found


def _to(ray: np.ndarray, axis: np.ndarray, focal: float, lens: DivisionModel, end: np.ndarray
        ) -> np.ndarray | None:
    """Return the image of the edge from a ray along an axis to about an image point."""
    there = np.append(lens.undistort(end) - lens.origin, focal)
    normal = np.cross(ray, axis)
    there -= normal * (normal @ there) / (normal @ normal)
    ends = [lens.distort(lens.origin + focal * r[:2] / r[2]) for r in (ray, there)]
    if there[2] <= 0 or not np.isfinite(ends).all():
        return None
    return edge(lens, *ends)


def clutter(count: int, random: np.random.Generator, shape: tuple[int, int] = SHAPE
            ) -> list[np.ndarray]:
    """Return straight lines of any direction, 40 to 160 px long."""
    size, found = np.array(shape[::-1]) - 1.0, []
    while len(found) < count:
        start, angle = random.uniform(0, size), random.uniform(0, 2 * np.pi)
        end = start + random.uniform(40, 160) * np.array([np.cos(angle), np.sin(angle)])
        if (end > 0).all() and (end < size).all():
            found.append(np.linspace(start, end, 60))
    return found


def place(axes: np.ndarray, focal: float, lam: float = 0.0, seed: int = 0,
          counts: tuple[int, ...] = (30, 40, 30), others: int = 20) -> Arcs:
    """Return the arcs of a place, the edges along each axis and then clutter."""
    random, lens = np.random.default_rng(seed), DivisionModel(lam, SHAPE)
    curves = pieces(axes, focal, lens, counts, random) + clutter(others, random)
    return arcs_of(curves, noise=0.3, seed=seed)


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle between two unit vectors, degrees."""
    return float(np.degrees(np.arccos(np.clip(a @ b, -1, 1))))


def scattered(arcs: Arcs, seed: int) -> Arcs:
    """Return arcs turned about their middles by as much as those of photographs scatter."""
    table, random = arcs.table.copy(), np.random.default_rng(seed)
    angles = np.radians(np.hypot(0.3, 28 / table['length'])) * random.standard_t(3, len(table)) / 2
    c, s = np.cos(angles), np.sin(angles)
    for name in ('start', 'end'):
        x, y = (table[name] - table['middle']).T
        table[name] = table['middle'] + np.column_stack([c * x - s * y, s * x + c * y])
    return replace(arcs, table=table)
