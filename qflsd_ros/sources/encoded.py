"""
Encoded images, as files, messages and recordings hold them, as arrays.

What an image claims of its size is looked at before it is decoded: few bytes can claim gigabytes,
or keep a decoder busy for hours.
"""
from __future__ import annotations

import cv2
import numpy as np

from qflsd_ros.sources import headers
from qflsd_ros.sources.depth import eight_bits, WHITE
from qflsd_ros.sources.frames import FrameError
from qflsd_ros.sources.reasons import Reason

MAX_SIDE = 32768        # px
MAX_PIXELS = 1 << 27    # 134 megapixels
MAX_VISITS = 1 << 32    # of pixels by the decoder: 32 scans of the largest JPEG

# Flags of cv2.imdecode.  An orientation tag would turn the coordinates; 16 bits stay.
GRAY, COLOUR = (kind | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
                for kind in (cv2.IMREAD_GRAYSCALE, cv2.IMREAD_COLOR))


class DecodingError(FrameError):
    """An encoded image that cannot be decoded, or is too large for that."""


def decode(data: bytes, flags: int, what: str, max_pixels: int = MAX_PIXELS) -> np.ndarray:
    """
    Return an encoded image as OpenCV decodes it.

    Parameters
    ----------
    data
        The whole image, in one of :data:`qflsd_ros.sources.headers.FORMATS`.
    flags
        Of ``cv2.imdecode``.
    what
        What to call it in an error.
    max_pixels
        Most pixels that it may have.

    Returns
    -------
    image
        (H, W) or (H, W, C), uint8 or whatever else ``flags`` allows.

    Raises
    ------
    DecodingError
        It is damaged or of another format, claims to be too large, or has too many scans.

    """
    width, height = _checked_size(headers.size(data), what, max_pixels)
    passes = headers.passes(data)
    if passes * width * height > MAX_VISITS:
        raise DecodingError(Reason.TOO_MANY_SCANS,
                            f'{what}: has {passes} scans of {width} x {height} pixels: must have '
                            f'at most {MAX_VISITS // (width * height)}')
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        image = None
    if image is None:
        raise _unreadable(what)
    return image


def decode_eight_bits(data: bytes, flags: int, what: str,
                      white_level: float | None = None,
                      max_pixels: int = MAX_PIXELS) -> np.ndarray:
    """
    Return an encoded image as the sensor saw it, in 8 bits whatever it has itself.

    Parameters
    ----------
    data, what, max_pixels
        As of :func:`decode`.
    flags
        :data:`GRAY` or :data:`COLOUR`.
    white_level
        Value that becomes 255 in images of 16 bits or floats; None stands for the white of a PNM
        that has one, else for 65535 with 16 bits and for 1.0 with floats.

    Returns
    -------
    image
        (H, W) or (H, W, 3) B, G, R uint8.

    Raises
    ------
    DecodingError
        As of :func:`decode`, or it has pixels of another type.

    """
    image = decode(data, flags, what, max_pixels)
    if image.dtype != np.uint8 and image.dtype not in WHITE:
        raise DecodingError(Reason.NO_IMAGE, f'{what}: has pixels of type {image.dtype}: must '
                            'have 8 or 16 bits, or floats of 32')
    return eight_bits(image, white_level or headers.white(data))


def _checked_size(claimed: headers.Size | None, what: str, max_pixels: int) -> headers.Size:
    if claimed is None:
        raise _unreadable(what)
    width, height = claimed
    if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE and width * height <= max_pixels):
        raise DecodingError(
            Reason.WRONG_SIZE, f'{what}: has {width} x {height} pixels: both must lie in 1 to '
            f'{MAX_SIDE}, and at most {max_pixels} pixels in all')
    return claimed


def _unreadable(what: str) -> DecodingError:
    return DecodingError(
        Reason.NO_IMAGE, f'{what}: no image that can be read: it is damaged or in another '
        f'format than {headers.FORMATS}')
