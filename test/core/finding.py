"""What a detector finds in an image."""
from __future__ import annotations

import numpy as np
from qflsd_ros.core import Arcs, Detector, DivisionModel, Parameters


def find(gray: np.ndarray, lens: DivisionModel | None = None, **parameters: float | str) -> Arcs:
    return Detector(Parameters(**parameters)).detect(gray, lens=lens)


def only(arcs: Arcs) -> np.void:
    """Return the row of the only arc."""
    assert len(arcs) == 1, arcs.table
    return arcs.table[0]


def samples(arcs: Arcs, i: int, count: int = 65) -> np.ndarray:
    """Return points of arc i as it is reported, evenly from start to end, (count, 2) px."""
    line = arcs.polylines(0.001)[i]
    along = np.cumsum([0, *np.hypot(*np.diff(line, axis=0).T)])
    at = np.linspace(0, along[-1], count)
    return np.column_stack([np.interp(at, along, line[:, k]) for k in range(2)])


def chord_angle(start: np.ndarray, end: np.ndarray) -> float:
    """Return the direction from one point to another, in radians."""
    return float(np.arctan2(end[1] - start[1], end[0] - start[0]))


def project(points: np.ndarray, line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances of (n, 2) points from a polyline, and where along it they are, px."""
    chords = np.diff(line, axis=0)
    sizes = np.hypot(*chords.T)
    relative = points[:, None] - line[None, :-1]
    share = np.clip((relative * chords).sum(axis=2) / sizes ** 2, 0, 1)
    off = np.hypot(*np.moveaxis(relative - share[..., None] * chords, 2, 0))
    rows, best = np.arange(len(points)), off.argmin(axis=1)
    begins = np.cumsum([0, *sizes])
    return off[rows, best], begins[best] + share[rows, best] * sizes[best]
