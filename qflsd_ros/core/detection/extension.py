"""Where an arc ends: where its edge does, which goes on for some px beyond its edge pixels."""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core import circle
from qflsd_ros.core.compilation import inlined
from qflsd_ros.core.detection.edges import SOBEL_GAIN
from qflsd_ros.core.detection.validation import Evidence, NOISE_ALIGNED

FARTHEST = 10           # px by which an end goes on beyond the last edge pixel
TURNED = math.sin(math.radians(14.0))   # of the angle between gradient and normal there


@inlined
def _goes_on(x: float, y: float, tx: float, ty: float, evidence: Evidence) -> bool:
    """Return whether there is an edge at a point, in the direction (tx, ty)."""
    column, row = int(x + 0.5), int(y + 0.5)
    if not (0 <= x <= evidence.dx.shape[1] - 1 and 0 <= y <= evidence.dx.shape[0] - 1):
        return False
    if evidence.region.masked and not evidence.region.seen[row, column]:
        return False
    gx, gy = evidence.dx[row, column] / SOBEL_GAIN, evidence.dy[row, column] / SOBEL_GAIN
    size = math.sqrt(gx * gx + gy * gy)
    aligned = abs(gx * tx + gy * ty) <= TURNED * size + NOISE_ALIGNED * evidence.noise
    return size >= evidence.clear and aligned


@inlined
def extended(fits: np.ndarray, arc: int, x: float, y: float, from_x: float, from_y: float,
             evidence: Evidence) -> tuple[float, float]:
    """
    Return where the end (x, y) of an arc that comes from another point goes on to.

    Edge pixels end where the gradient begins to turn towards another edge, and before the border
    of the image.  The edge itself goes on as long as the gradient is at right angles to it, but
    not to where a mask leaves none.
    """
    _, _, tx, ty = circle.foot(fits, arc, x, y)
    if tx * (x - from_x) + ty * (y - from_y) < 0:
        tx, ty = -tx, -ty
    for _ in range(FARTHEST):
        u, v, ux, uy = circle.foot(fits, arc, x + tx, y + ty)
        if ux * tx + uy * ty < 0:
            ux, uy = -ux, -uy
        if not _goes_on(u, v, ux, uy, evidence):
            break
        x, y, tx, ty = u, v, ux, uy
    # Half a pixel more, since that far the last pixel reaches.
    u, v, _, _ = circle.foot(fits, arc, x + tx / 2, y + ty / 2)
    return u, v
