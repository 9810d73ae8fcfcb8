"""Images of 16 bits or floats as images of 8 bits."""
from __future__ import annotations

import cv2
import numpy as np

# The white level of a type unless another is given.
WHITE = {np.dtype(np.uint16): 65535.0, np.dtype(np.float32): 1.0}


def eight_bits(image: np.ndarray, white_level: float | None = None) -> np.ndarray:
    """
    Scale an image linearly so that its white level becomes 255; what is beyond is cut off.

    Parameters
    ----------
    image
        (H, W) or (H, W, C), uint8, uint16 or float32, in native order.
    white_level
        Value that becomes 255; None stands for the largest of 16 bits and for 1.0 with floats.

    Returns
    -------
    scaled
        uint8 of the same shape; of uint8 the image itself.

    """
    if image.dtype == np.uint8:
        return image
    white = WHITE[image.dtype] if white_level is None else white_level
    if image.dtype == np.float32:
        # convertScaleAbs would mirror what is below 0, and has no rule for inf and nan.
        image = np.fmin(np.fmax(image, 0), white)
    return cv2.convertScaleAbs(image, alpha=255 / white)
