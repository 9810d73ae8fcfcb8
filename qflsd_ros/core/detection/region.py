"""The region of an image in which arcs are detected: all pixels, or those that a mask allows."""
from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np

from qflsd_ros.core.compilation import inlined

# px around masked pixels in which gradients do not count: the usual blur and Sobel reach 3 px.
MARGIN = 3
# px between the points of an arc that are compared with a mask, at most: half a pixel, so that
# hardly any masked pixel on the arc is missed; chosen, not tuned.
SAMPLED = 0.5


class Region(NamedTuple):
    """The part of an image of (H, W) pixels in which arcs are sought."""

    masked: bool            # whether any pixel is left out
    allowed: np.ndarray     # (H, W) bool: where the points of arcs may lie
    seen: np.ndarray        # (H, W) bool: where no masked pixel is within MARGIN
    top: int                # rows top to bottom - 1 and columns left to right - 1 hold all that
    bottom: int             # is allowed
    left: int
    right: int


def region(shape: tuple[int, int], mask: np.ndarray | None) -> Region:
    """Return the region where a mask, (H, W) uint8 or bool, is not 0; None: the whole image."""
    height, width = shape
    if mask is None or (mask != 0).all():
        everywhere = np.ones(shape, np.bool_)
        return Region(False, everywhere, everywhere, 0, height, 0, width)
    allowed = np.ascontiguousarray(mask != 0)
    side = 2 * MARGIN + 1
    seen = cv2.erode(allowed.view(np.uint8), np.ones((side, side), np.uint8)).view(np.bool_)
    (top, bottom), (left, right) = (_extent(np.any(allowed, axis=axis)) for axis in (1, 0))
    return Region(True, allowed, seen, top, bottom, left, right)


def _extent(lines: np.ndarray) -> tuple[int, int]:
    """Return the index of the first True, and the one after the last; 0, 0 without any."""
    wanted = np.flatnonzero(lines)
    return (int(wanted[0]), int(wanted[-1]) + 1) if len(wanted) else (0, 0)


@inlined
def transposed(where: Region) -> Region:
    """Return a region of the transposed image."""
    return Region(where.masked, where.allowed.T, where.seen.T, where.left, where.right, where.top,
                  where.bottom)


@inlined
def is_open(allowed: np.ndarray, x: float, y: float) -> bool:
    """Return whether no masked pixel is within half a sampling step of a point, along x and y."""
    for side_x in (-SAMPLED / 2, SAMPLED / 2):
        column = min(max(int(math.floor(x + side_x + 0.5)), 0), allowed.shape[1] - 1)
        for side_y in (-SAMPLED / 2, SAMPLED / 2):
            row = min(max(int(math.floor(y + side_y + 0.5)), 0), allowed.shape[0] - 1)
            if not allowed[row, column]:
                return False
    return True
