"""Colours that say something about an arc: pure numpy, imports no ROS."""
from __future__ import annotations

from typing import Callable

import cv2
import numpy as np
from qflsd_ros import overlay
from qflsd_ros.core.arcs import Arcs

STEPS = 256


def _logarithm(values: np.ndarray, low: float, high: float) -> np.ndarray:
    return np.log(np.maximum(values, low) / low) / np.log(high / low)


# From what is blue (0) to what is red (1): the same on every frame, so that no colour flickers.
SCALES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    'length': lambda table: _logarithm(table['length'], 10, 1000),               # px
    'curvature': lambda table: _logarithm(np.abs(table['curvature']), 1e-5, 1e-2),  # 1/px
    'score': lambda table: _logarithm(table['score'], 1, 1000),
}
CHOICES = ('id', *SCALES)


def colours(arcs: Arcs, by: str) -> np.ndarray:
    """
    Return a colour for every arc: (M, 3) uint8, B, G, R.

    By ``id``, all colours differ; by ``length`` (10 to 1000 px), ``curvature`` (1e-5 to 1e-2 per
    px, either way) or ``score`` (1 to 1000), they go from blue to red on a logarithmic scale.
    """
    if by == 'id':
        return overlay.colours(len(arcs))
    shade = np.clip(SCALES[by](arcs.table), 0, 1) * (STEPS - 1)
    return _ramp()[np.rint(shade).astype(np.intp)]


def _ramp() -> np.ndarray:
    """Return the colour map: (STEPS, 3) uint8, B, G, R."""
    return cv2.applyColorMap(np.arange(STEPS, dtype=np.uint8), cv2.COLORMAP_TURBO).reshape(-1, 3)
