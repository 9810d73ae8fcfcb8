"""Conversion of compressed image messages into grey frames."""
from __future__ import annotations

import numpy as np
from qflsd_ros.sources import encoded
from qflsd_ros.sources.headers import JPEG_START, PNG_START
from qflsd_ros.sources.reasons import Reason
from sensor_msgs.msg import CompressedImage


def decode(message: CompressedImage, white_level: float = 0.0,
           max_pixels: int = encoded.MAX_PIXELS) -> np.ndarray:
    """
    Decode a compressed image, JPEG or PNG, as a grey frame.

    Parameters
    ----------
    message
        The image; its field ``format`` is ignored.
    white_level
        Pixel value that becomes 255 in images of 16 bits; 0 means 65535.
    max_pixels
        Largest number of pixels allowed, checked before the image is decoded.

    Returns
    -------
    gray
        (H, W) uint8.

    Raises
    ------
    DecodingError
        The data is neither JPEG nor PNG, is damaged, or declares too large an image.

    """
    data = bytes(message.data)
    what = f'compressed image of {len(data)} bytes, format {message.format!r}'
    if not data.startswith((JPEG_START, PNG_START)):
        raise encoded.DecodingError(Reason.NO_IMAGE, f'{what}: must be a JPEG or PNG')
    return encoded.decode_eight_bits(data, encoded.GRAY, what, white_level or None, max_pixels)
