"""Colours of arcs by one of their properties; imports no ROS."""
from __future__ import annotations

from typing import Callable

import cv2
import numpy as np
from qflsd_ros import overlay
from qflsd_ros.core.arcs import Arcs

STEPS = 256  # entries of OpenCV's colour maps


def _logarithm(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return values on a logarithmic scale on which low is 0 and high is 1; never below 0."""
    return np.log(np.maximum(values, low) / low) / np.log(high / low)


# Scales from 0 (blue) to 1 (red), the same in every frame, so that colours do not flicker.  Their
# ends span the arcs of a usual image.
SCALES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    'length': lambda table: _logarithm(table['length'], 10, 1000),               # px
    'curvature': lambda table: _logarithm(np.abs(table['curvature']), 1e-5, 1e-2),  # 1/px
    'score': lambda table: _logarithm(table['score'], 1, 1000),
}
CHOICES = ('track', 'id', *SCALES, 'direction')


def colours(arcs: Arcs, by: str) -> np.ndarray:
    """
    Return one colour for each arc: (M, 3) uint8; blue, green, red.

    By ``track``, a line has the same colour in every frame; arcs without tracks have the colours
    of ``id``.  By ``id``, all colours of a frame differ.  By ``length`` (10 to 1000 px), absolute
    ``curvature`` (1e-5 to 1e-2 per px) or ``score`` (1 to 1000), they run from blue to red on a
    logarithmic scale.  By ``direction``, see :func:`qflsd_ros.overlay.direction_colours`.
    """
    if by == 'track':
        return overlay.colours(overlay.numbers(arcs))
    if by == 'id':
        return overlay.colours(np.arange(len(arcs)))
    if by == 'direction':
        return overlay.direction_colours(arcs)
    shade = np.clip(SCALES[by](arcs.table), 0, 1) * (STEPS - 1)
    return _ramp()[np.rint(shade).astype(np.intp)]


def _ramp() -> np.ndarray:
    """Return the colour map: (STEPS, 3) uint8; blue, green, red."""
    return cv2.applyColorMap(np.arange(STEPS, dtype=np.uint8), cv2.COLORMAP_TURBO).reshape(-1, 3)
