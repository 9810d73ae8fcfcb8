"""Conversion of 16-bit and float images to 8 bits."""
from __future__ import annotations

import cv2
import numpy as np

# Default white level of each type: the largest 16-bit value, and the usual white of floats.
WHITE = {np.dtype(np.uint16): 65535.0, np.dtype(np.float32): 1.0}


def eight_bits(image: np.ndarray, white_level: float | None = None) -> np.ndarray:
    """
    Scale an image linearly so that its white level becomes 255; larger values become 255 too.

    Parameters
    ----------
    image
        (H, W) or (H, W, C), uint8, uint16 or float32, in native order.
    white_level
        Value that becomes 255; None stands for 65535 (uint16) or 1.0 (float32).

    Returns
    -------
    scaled
        uint8 of the same shape; a uint8 image is returned as it is.

    """
    if image.dtype == np.uint8:
        return image
    white = WHITE[image.dtype] if white_level is None else white_level
    if image.dtype == np.float32:
        # convertScaleAbs takes absolute values, and its results for inf and nan are undefined.
        image = np.fmin(np.fmax(image, 0), white)
    return cv2.convertScaleAbs(image, alpha=255 / white)
