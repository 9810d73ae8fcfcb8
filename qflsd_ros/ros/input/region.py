"""The part of an image in which arcs are sought, and how finely; imports no ROS."""
from __future__ import annotations

from functools import cache, lru_cache
import math
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources.files import read_image
from qflsd_ros.sources.frames import FrameError
from qflsd_ros.sources.reasons import Reason

WHITE = 128  # grey levels from which on a pixel of a mask file is white


class ViewError(FrameError):
    """A region or mask that does not fit."""


class View(NamedTuple):
    """
    How to look at images of one size.

    Attributes
    ----------
    factor
        By how much they are made smaller.
    mask
        (H // factor, W // factor) bool, True where arcs are sought; None: everywhere.

    """

    factor: int
    mask: np.ndarray | None


@lru_cache(maxsize=1)
def view(settings: Settings, height: int, width: int) -> View:
    """
    Return how to look at images of a size, in px.

    Raises
    ------
    ViewError
        The region lies outside, or the mask has another size.
    SourceError
        The mask cannot be read, unless :func:`read_mask` has done so before.

    """
    limit = settings.max_width or width
    factor = min(math.ceil(width / limit), height)
    allowed = np.zeros((height, width), np.uint8)
    allowed[_region(settings, height, width)] = 255
    if settings.mask:
        allowed[~_fitting_mask(settings.mask, height, width)] = 0
    # A block of pixels of which some are masked is masked.
    mask = reduced(allowed, factor) == 255
    return View(factor, None if mask.all() else mask)


def reduced(image: np.ndarray, factor: int) -> np.ndarray:
    """
    Return the means of blocks of factor x factor pixels: (H // factor, W // factor) uint8.

    Rows and columns at the end that fill no block are left out.
    """
    if factor == 1:
        return image
    height, width = image.shape[0] // factor, image.shape[1] // factor
    return cv2.resize(image[:height * factor, :width * factor], (width, height),
                      interpolation=cv2.INTER_AREA)


@cache
def read_mask(path: str) -> np.ndarray:
    """Return an image file as a mask, (H, W) bool, read once; SourceError where that fails."""
    return read_image(Path(path), colour=False) >= WHITE


def _fitting_mask(path: str, height: int, width: int) -> np.ndarray:
    mask = read_mask(path)
    if mask.shape != (height, width):
        raise ViewError(Reason.OTHER_MASK,
                        f'mask {path!r} has {mask.shape[1]} x {mask.shape[0]} pixels: must have '
                        f'{width} x {height}, as the image')
    return mask


def _region(settings: Settings, height: int, width: int) -> tuple[slice, slice]:
    x, y = settings.roi_x, settings.roi_y
    if x >= width or y >= height:
        raise ViewError(Reason.REGION_OUTSIDE,
                        f'region begins at roi_x {x}, roi_y {y}: must begin inside the image of '
                        f'{width} x {height} pixels')
    return (slice(y, y + settings.roi_height if settings.roi_height else None),
            slice(x, x + settings.roi_width if settings.roi_width else None))
