"""
Decoding of images from files, messages and recordings.

The size in an image's header is checked before the image is decoded: a few bytes can claim
gigabytes, or keep a decoder busy for hours.
"""
from __future__ import annotations

import cv2
import numpy as np

from qflsd_ros.sources import headers
from qflsd_ros.sources.depth import eight_bits, WHITE
from qflsd_ros.sources.frames import FrameError
from qflsd_ros.sources.reasons import Reason

MAX_SIDE = 32768        # px, beyond any camera
MAX_PIXELS = 1 << 27    # 134 megapixels: beyond any camera, and below 1 GB when decoded
MAX_VISITS = 1 << 32    # pixels that a decoder may write, all scans together: 32 of MAX_PIXELS

# Flags of cv2.imdecode.  Orientation tags are ignored, since they would rotate the coordinates;
# 16-bit and float values are kept.
GRAY, COLOUR = (kind | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
                for kind in (cv2.IMREAD_GRAYSCALE, cv2.IMREAD_COLOR))


class DecodingError(FrameError):
    """An encoded image cannot be decoded or exceeds a limit."""


def decode(data: bytes, flags: int, what: str, max_pixels: int = MAX_PIXELS) -> np.ndarray:
    """
    Decode an image by OpenCV.

    Parameters
    ----------
    data
        The complete image, in one of :data:`qflsd_ros.sources.headers.FORMATS`.
    flags
        Flags of ``cv2.imdecode``.
    what
        Name of the image for errors.
    max_pixels
        Greatest number of pixels.

    Returns
    -------
    image
        (H, W) or (H, W, C), of uint8 or another type that ``flags`` allow.

    Raises
    ------
    DecodingError
        The image is damaged, has another format, is too large, or has too many scans.

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
    Decode an image and convert it to 8 bits; an orientation tag is ignored.

    Parameters
    ----------
    data, what, max_pixels
        As in :func:`decode`.
    flags
        :data:`GRAY` or :data:`COLOUR`.
    white_level
        Value of 16-bit and float images that becomes 255; None stands for the maximum in the
        header of a PGM or PPM, and in other formats for 65535 (16 bits) or 1.0 (floats).

    Returns
    -------
    image
        (H, W) or (H, W, 3) B, G, R uint8.

    Raises
    ------
    DecodingError
        As in :func:`decode`, or the pixels have another type.

    """
    image = decode(data, flags, what, max_pixels)
    if image.dtype != np.uint8 and image.dtype not in WHITE:
        raise DecodingError(Reason.NO_IMAGE, f'{what}: has pixels of type {image.dtype}: must '
                            'have 8 or 16 bits, or floats of 32')
    return eight_bits(image, white_level or headers.white(data))


def _checked_size(claimed: headers.Size | None, what: str, max_pixels: int) -> headers.Size:
    """Return width and height of an image; DecodingError if they are unknown or too large."""
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
