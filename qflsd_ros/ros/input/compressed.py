"""Compressed image messages as grey frames."""
from __future__ import annotations

import numpy as np
from qflsd_ros.sources import encoded
from qflsd_ros.sources.headers import JPEG_START, PNG_START
from qflsd_ros.sources.reasons import Reason
from sensor_msgs.msg import CompressedImage


def decode(message: CompressedImage, white_level: float = 0.0,
           max_pixels: int = encoded.MAX_PIXELS) -> np.ndarray:
    """
    Return a compressed image, JPEG or PNG, as a grey frame.

    Parameters
    ----------
    message
        The image; what its ``format`` says is not looked at.
    white_level
        Value that becomes 255 in images of 16 bits; 0 stands for 65535.
    max_pixels
        Most pixels that an image may have, seen before it is decoded.

    Returns
    -------
    gray
        (H, W) uint8.

    Raises
    ------
    DecodingError
        The data is no JPEG or PNG, is damaged, or claims to be too large.

    """
    data = bytes(message.data)
    what = f'compressed image of {len(data)} bytes, format {message.format!r}'
    if not data.startswith((JPEG_START, PNG_START)):
        raise encoded.DecodingError(Reason.NO_IMAGE, f'{what}: must be a JPEG or PNG')
    return encoded.decode_eight_bits(data, encoded.GRAY, what, white_level or None, max_pixels)
