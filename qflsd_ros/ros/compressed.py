"""
Compressed image messages as grey frames.

What an image claims of its size is read before it is decoded: a few bytes can claim gigabytes.
"""
from __future__ import annotations

import struct

import cv2
import numpy as np
from qflsd_ros.ros.images import ImageError, MAX_SIDE
from sensor_msgs.msg import CompressedImage

MAX_PIXELS = 1 << 27  # 128 megapixels, the most that is decoded
PNG_START = b'\x89PNG\r\n\x1a\n'
JPEG_START = b'\xff\xd8'
# Start-of-frame markers; C4, C8 and CC between them mean something else.
JPEG_FRAMES = frozenset(range(0xc0, 0xd0)) - {0xc4, 0xc8, 0xcc}
JPEG_ALONE = frozenset({0x01, *range(0xd0, 0xd9)})  # markers of segments without a length


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
    ImageError
        The data is no JPEG or PNG, is damaged, or claims to be too large.

    """
    what = f'compressed image of {len(message.data)} bytes, format {message.format!r}'
    _check_size(bytes(message.data), what)
    data = np.ndarray(len(message.data), np.uint8, message.data)
    # As the sensor sees it: an orientation tag would turn the coordinates.
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        gray = cv2.imdecode(data, flags)
    except cv2.error as error:
        raise ImageError('cannot be decoded', f'{what}: {error.err}') from error
    if gray is None:
        raise ImageError('cannot be decoded', f'{what}: is damaged')
    return gray


def size(data: bytes) -> tuple[int, int] | None:
    """Return width and height, px, that a JPEG or PNG claims; None where it is neither."""
    if data.startswith(PNG_START):
        return struct.unpack_from('>II', data, 16) if len(data) >= 24 else None
    if not data.startswith(JPEG_START):
        return None
    at = len(JPEG_START)
    while at + 9 <= len(data) and data[at] == 0xff:
        marker = data[at + 1]
        if marker in JPEG_FRAMES:
            height, width = struct.unpack_from('>HH', data, at + 5)
            return width, height
        if marker == 0xff:
            at += 1  # a byte of filling
        elif marker in JPEG_ALONE:
            at += 2
        else:
            at += 2 + struct.unpack_from('>H', data, at + 2)[0]
    return None


def _check_size(data: bytes, what: str) -> None:
    claimed = size(data)
    if claimed is None:
        raise ImageError('cannot be decoded', f'{what}: must be a JPEG or PNG')
    width, height = claimed
    if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE and width * height <= MAX_PIXELS):
        raise ImageError('wrong size', f'{what}: has {width} x {height} pixels: both must lie in '
                         f'1 to {MAX_SIDE}, and at most {MAX_PIXELS} pixels in all')
