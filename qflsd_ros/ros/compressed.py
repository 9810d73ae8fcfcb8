"""Compressed image messages as grey frames."""
from __future__ import annotations

import cv2
import numpy as np
from qflsd_ros.sources import encoded
from qflsd_ros.sources.headers import JPEG_START, PNG_START
from sensor_msgs.msg import CompressedImage


def decode(message: CompressedImage, white_level: float = 0.0) -> np.ndarray:
    """
    Return a compressed image, JPEG or PNG, as a grey frame.

    Parameters
    ----------
    message
        The image; what its ``format`` says is not looked at.
    white_level
        Of no effect: the decoder itself brings 16 bits down to 8.

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
        raise encoded.DecodingError('cannot be decoded', f'{what}: must be a JPEG or PNG')
    # As the sensor sees it: an orientation tag would turn the coordinates.
    return encoded.decode(data, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION, what)
