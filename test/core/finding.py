"""What a detector finds in an image."""
from __future__ import annotations

import numpy as np
from qflsd_ros.core import Arcs, Detector, Parameters


def find(gray: np.ndarray, **parameters: float | str) -> Arcs:
    return Detector(Parameters(**parameters)).detect(gray)


def only(arcs: Arcs) -> np.void:
    """Return the row of the only arc."""
    assert len(arcs) == 1, arcs.table
    return arcs.table[0]


def samples(arcs: Arcs, i: int) -> np.ndarray:
    """Return points of arc i as it is reported, (K, 2) px, close together."""
    return arcs.polylines(0.001)[i]


def chord_angle(start: np.ndarray, end: np.ndarray) -> float:
    """Return the direction from one point to another, in radians."""
    return float(np.arctan2(end[1] - start[1], end[0] - start[0]))
