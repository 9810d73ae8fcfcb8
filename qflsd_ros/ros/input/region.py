"""The region of an image in which arcs are detected, and its resolution; imports no ROS."""
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

WHITE = 128  # grey level from which on a pixel of a mask file is white, half of the range


class ViewError(FrameError):
    """The region or the mask does not fit the image."""


class View(NamedTuple):
    """
    The view of the detector on images of one size.

    Attributes
    ----------
    factor
        Factor by which they are reduced.
    mask
        (H // factor, W // factor) bool, True where arcs are detected; None means everywhere.

    """

    factor: int
    mask: np.ndarray | None


@lru_cache(maxsize=1)
def view(settings: Settings, height: int, width: int) -> View:
    """
    Return the view on images of a height and width in px.

    Raises
    ------
    ViewError
        The region lies outside the image, or the mask has another size.
    SourceError
        The mask file cannot be read; :func:`read_mask` reads it once only.

    """
    limit = settings.max_width or width
    factor = min(math.ceil(width / limit), height)
    allowed = np.zeros((height, width), np.uint8)
    allowed[_region(settings, height, width)] = 255
    if settings.mask:
        allowed[~_fitting_mask(settings.mask, height, width)] = 0
    # A pixel of the reduced image counts only if all pixels of its block do.
    mask = reduced(allowed, factor) == 255
    return View(factor, None if mask.all() else mask)


def reduced(image: np.ndarray, factor: int) -> np.ndarray:
    """
    Return the means of blocks of factor x factor pixels: (H // factor, W // factor) uint8.

    Rows and columns at the end that do not fill a block are left out.
    """
    if factor == 1:
        return image
    height, width = image.shape[0] // factor, image.shape[1] // factor
    return cv2.resize(image[:height * factor, :width * factor], (width, height),
                      interpolation=cv2.INTER_AREA)


@cache
def read_mask(path: str) -> np.ndarray:
    """Read an image file as a mask, (H, W) bool, once; SourceError if it cannot be read."""
    return read_image(Path(path), colour=False) >= WHITE


def _fitting_mask(path: str, height: int, width: int) -> np.ndarray:
    mask = read_mask(path)
    if mask.shape != (height, width):
        raise ViewError(Reason.OTHER_MASK,
                        f'mask {path!r} has {mask.shape[1]} x {mask.shape[0]} pixels: must have '
                        f'{width} x {height}, like the image')
    return mask


def _region(settings: Settings, height: int, width: int) -> tuple[slice, slice]:
    x, y = settings.roi_x, settings.roi_y
    if x >= width or y >= height:
        raise ViewError(Reason.REGION_OUTSIDE,
                        f'region begins at roi_x {x}, roi_y {y}: must begin inside the image of '
                        f'{width} x {height} pixels')
    return (slice(y, y + settings.roi_height if settings.roi_height else None),
            slice(x, x + settings.roi_width if settings.roi_width else None))
