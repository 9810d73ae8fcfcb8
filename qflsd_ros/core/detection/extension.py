"""
End extension: an arc ends where its edge ends, some px beyond its last edge pixel.

Edge pixels end where the gradient turns towards another edge, and before the border of the image.
The edge continues as long as the gradient is normal to it.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.compilation import inlined
from qflsd_ros.core.detection.contours.gradients import GAIN
from qflsd_ros.core.detection.frame import Frame
from qflsd_ros.core.detection.validation import NOISE_ALIGNED

# All of these are chosen, not tuned, unless stated otherwise.
FARTHEST = 10           # px of extension, at most: blurred edges lose as much at a corner
TURNED = math.sin(math.radians(14.0))   # sine of the angle between gradient and normal, at most


@inlined
def _continues(frame: Frame, x: float, y: float, tx: float, ty: float) -> bool:
    """Return whether there is an edge at a point, in the direction (tx, ty)."""
    column, row = int(x + 0.5), int(y + 0.5)
    if not (0 <= x <= frame.dx.shape[1] - 1 and 0 <= y <= frame.dx.shape[0] - 1):
        return False
    if frame.region.masked and not frame.region.seen[row, column]:
        return False
    gx, gy = frame.dx[row, column] / GAIN, frame.dy[row, column] / GAIN
    size = math.sqrt(gx * gx + gy * gy)
    aligned = abs(gx * tx + gy * ty) <= TURNED * size + NOISE_ALIGNED * frame.noise
    return size >= frame.high and aligned


@inlined
def extended(fits: np.ndarray, arc: int, frame: Frame, end: tuple[float, float],
             start: tuple[float, float]) -> tuple[float, float]:
    """Return the extended end of the arc between two points of a fit."""
    x, y = end
    _, _, tx, ty = circle.foot(fits, arc, x, y)
    if tx * (x - start[0]) + ty * (y - start[1]) < 0:
        tx, ty = -tx, -ty
    for _ in range(FARTHEST):
        u, v, ux, uy = circle.foot(fits, arc, x + tx, y + ty)
        if ux * tx + uy * ty < 0:
            ux, uy = -ux, -uy
        if not _continues(frame, u, v, ux, uy):
            break
        x, y, tx, ty = u, v, ux, uy
    # The last pixel reaches half a pixel farther.
    u, v, _, _ = circle.foot(fits, arc, x + tx / 2, y + ty / 2)
    return u, v
