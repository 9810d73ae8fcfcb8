"""The region of an image in which arcs are detected: all pixels, or those that a mask allows."""
from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np

from qflsd_ros.core.compilation import compiled, inlined

# px around masked pixels in which gradients do not count: the usual blur and Sobel reach 3 px.
MARGIN = 3
# px between the points of an arc that are compared with a mask, at most: half a pixel, so that
# hardly any masked pixel on the arc is missed; chosen, not tuned.
SAMPLED = 0.5
# px from a point to the farthest pixel that is compared with a mask for it
COMPARED = math.sqrt(2) * (SAMPLED / 2 + 0.5)


class Disc(NamedTuple):
    """The points within a circle, px."""

    x: float
    y: float
    radius: float


class Region(NamedTuple):
    """
    The part of an image of (H, W) pixels in which arcs are sought.

    ``seen`` leaves out masked pixels and those within MARGIN of them, in x and in y.
    """

    masked: bool            # whether any pixel is left out
    allowed: np.ndarray     # (H, W) bool: where the points of arcs may lie
    seen: np.ndarray        # (H, W) bool: where no masked pixel is within MARGIN
    top: int                # rows top to bottom - 1 and columns left to right - 1 hold all that
    bottom: int             # is allowed
    left: int
    right: int
    clear: Disc             # without a masked pixel; part of it may lie outside of the image


def region(shape: tuple[int, int], mask: np.ndarray | None) -> Region:
    """Return the region where a mask, (H, W) uint8 or bool, is not 0; None: the whole image."""
    height, width = shape
    if mask is None or (mask != 0).all():
        everywhere = np.ones(shape, np.bool_)
        whole = Disc(width / 2, height / 2, math.hypot(height, width))
        return Region(False, everywhere, everywhere, 0, height, 0, width, whole)
    allowed = np.ascontiguousarray(mask != 0)
    side = 2 * MARGIN + 1
    seen = cv2.erode(allowed.view(np.uint8), np.ones((side, side), np.uint8)).view(np.bool_)
    (top, bottom), (left, right) = (_extent(np.any(allowed, axis=axis)) for axis in (1, 0))
    return Region(True, allowed, seen, top, bottom, left, right, _largest_disc(allowed))


def _largest_disc(allowed: np.ndarray) -> Disc:
    """Return the largest disc in which all pixels are allowed, (H, W) bool, some of them not."""
    distances = cv2.distanceTransform(allowed.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    _, distance, _, (x, y) = cv2.minMaxLoc(distances)
    return Disc(float(x), float(y), max(0.0, distance - 1))


def _extent(lines: np.ndarray) -> tuple[int, int]:
    """Return the index of the first True, and the one after the last; 0, 0 without any."""
    wanted = np.flatnonzero(lines)
    return (int(wanted[0]), int(wanted[-1]) + 1) if len(wanted) else (0, 0)


def within(where: Region, disc: Disc, pixels: np.ndarray) -> Region:
    """
    Return the part of a region of (H, W) pixels that lies in a disc.

    Its arrays are views of ``pixels``, (2, H, W) bool.
    """
    allowed, seen = pixels
    _fill(where.allowed, disc, 0.0, allowed)
    _fill(where.seen, disc, float(MARGIN), seen)
    clear = where.clear
    distance = math.hypot(clear.x - disc.x, clear.y - disc.y)
    radius = min(clear.radius, max(0.0, disc.radius - distance))
    return Region(True, allowed, seen,
                  max(where.top, math.ceil(disc.y - disc.radius)),
                  min(where.bottom, math.floor(disc.y + disc.radius) + 1),
                  max(where.left, math.ceil(disc.x - disc.radius)),
                  min(where.right, math.floor(disc.x + disc.radius) + 1),
                  Disc(clear.x, clear.y, radius) if where.masked else disc)


@compiled
def _fill(usual: np.ndarray, disc: Disc, margin: float, pixels: np.ndarray) -> None:
    """
    Write which pixels of ``usual``, (H, W) bool, lie in a disc.

    So do all pixels that are not farther than ``margin`` px from them, in x and in y.
    """
    x, y, radius = disc
    for row in range(usual.shape[0]):
        rest = radius ** 2 - (abs(row - y) + margin) ** 2
        half = math.sqrt(rest) - margin if rest >= 0 else -1.0
        left = min(max(int(math.ceil(x - half)), 0), usual.shape[1])
        right = min(max(int(math.floor(x + half)) + 1, left), usual.shape[1])
        pixels[row, :left] = False
        for column in range(left, right):
            pixels[row, column] = usual[row, column]
        pixels[row, right:] = False


@inlined
def transposed(where: Region) -> Region:
    """Return a region of the transposed image."""
    clear = Disc(where.clear.y, where.clear.x, where.clear.radius)
    return Region(where.masked, where.allowed.T, where.seen.T, where.left, where.right, where.top,
                  where.bottom, clear)


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
