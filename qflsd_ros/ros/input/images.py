"""
Conversion of image messages into grey frames.

Integers of 16 bits and floats are scaled linearly, so that 0 becomes 0 and the white level 255;
values outside that range are clipped.  YUV images give their luma; OpenCV converts colour and
Bayer images.
"""
from __future__ import annotations

from functools import partial
from typing import Callable, NamedTuple, TYPE_CHECKING

import cv2
import numpy as np
from qflsd_ros.sources.depth import eight_bits
from qflsd_ros.sources.encoded import MAX_PIXELS, MAX_SIDE
from qflsd_ros.sources.frames import FrameError
from qflsd_ros.sources.reasons import Reason

if TYPE_CHECKING:
    from qflsd_ros.sources.frames import Frame
    from sensor_msgs.msg import Image


class ImageError(FrameError):
    """An image that cannot be read."""


class Layout(NamedTuple):
    """
    The layout of an image in one encoding.

    Attributes
    ----------
    dtype
        Type of a value in numpy's notation, without byte order.
    channels
        Number of values in a pixel.
    to_gray
        Converts an image, (H, W, channels), into grey values, (H, W).

    """

    dtype: str
    channels: int
    to_gray: Callable[[np.ndarray], np.ndarray]


def _channel(index: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda pixels: pixels[..., index]


def _colour(code: int) -> Callable[[np.ndarray], np.ndarray]:
    return partial(cv2.cvtColor, code=code)


def _bayer(code: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda pixels: cv2.cvtColor(pixels[..., 0], code)


LAYOUTS = {
    'mono8': Layout('u1', 1, _channel(0)),
    '8UC1': Layout('u1', 1, _channel(0)),
    'mono16': Layout('u2', 1, _channel(0)),
    '16UC1': Layout('u2', 1, _channel(0)),
    '32FC1': Layout('f4', 1, _channel(0)),
    'yuv422': Layout('u1', 2, _channel(1)),
    'uyvy': Layout('u1', 2, _channel(1)),
    'yuv422_yuy2': Layout('u1', 2, _channel(0)),
    'yuyv': Layout('u1', 2, _channel(0)),
    # The plane of luma comes first; the chroma behind it is ignored.
    'nv12': Layout('u1', 1, _channel(0)),
    'nv21': Layout('u1', 1, _channel(0)),
    'nv24': Layout('u1', 1, _channel(0)),
}
for _bits, _dtype in ((8, 'u1'), (16, 'u2')):
    LAYOUTS.update({
        f'bgr{_bits}': Layout(_dtype, 3, _colour(cv2.COLOR_BGR2GRAY)),
        f'rgb{_bits}': Layout(_dtype, 3, _colour(cv2.COLOR_RGB2GRAY)),
        f'bgra{_bits}': Layout(_dtype, 4, _colour(cv2.COLOR_BGRA2GRAY)),
        f'rgba{_bits}': Layout(_dtype, 4, _colour(cv2.COLOR_RGBA2GRAY)),
        # OpenCV names a pattern by the second row's second and third pixel.
        f'bayer_rggb{_bits}': Layout(_dtype, 1, _bayer(cv2.COLOR_BayerBG2GRAY)),
        f'bayer_bggr{_bits}': Layout(_dtype, 1, _bayer(cv2.COLOR_BayerRG2GRAY)),
        f'bayer_gbrg{_bits}': Layout(_dtype, 1, _bayer(cv2.COLOR_BayerGR2GRAY)),
        f'bayer_grbg{_bits}': Layout(_dtype, 1, _bayer(cv2.COLOR_BayerGB2GRAY)),
    })


def read(message: Image | Frame, white_level: float = 0.0,
         max_pixels: int = MAX_PIXELS) -> np.ndarray:
    """
    Convert an image into a grey frame.

    Parameters
    ----------
    message
        The image, in one of the encodings of :data:`LAYOUTS`; a frame of a recording has the
        same fields and is accepted as well.
    white_level
        Pixel value that becomes 255 in images of 16 bits or floats; 0 means 65535 for 16 bits
        and 1.0 for floats.
    max_pixels
        Largest number of pixels allowed.

    Returns
    -------
    gray
        (H, W) uint8; for mono8, 8UC1 and YUV a view of the message's data, with its strides.

    Raises
    ------
    ImageError
        The encoding is unknown, or the sizes in the message contradict each other.

    """
    layout = LAYOUTS.get(message.encoding)
    if layout is None:
        raise ImageError(
            Reason.UNKNOWN_ENCODING, f'encoding {message.encoding!r} is unknown: must be one of '
            f'{", ".join(sorted(LAYOUTS))}')
    _check_size(message, layout, max_pixels)
    order = '>' if message.is_bigendian else '<'
    dtype = np.dtype(order + layout.dtype)
    pixels = np.ndarray(
        (message.height, message.width, layout.channels), dtype, message.data,
        strides=(message.step, layout.channels * dtype.itemsize, dtype.itemsize))
    # OpenCV misreads rows of 16 bits that begin at an odd address.
    gray = layout.to_gray(np.require(pixels, dtype.newbyteorder('='), ['ALIGNED']))
    return eight_bits(gray, white_level or None)


def _check_size(message: Image | Frame, layout: Layout, max_pixels: int) -> None:
    height, width, step, size = message.height, message.width, message.step, len(message.data)
    what = f'{message.encoding} image of {width} x {height} pixels'
    if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE and width * height <= max_pixels):
        raise ImageError(Reason.WRONG_SIZE, f'{what}: width and height must lie in 1 to {MAX_SIDE}'
                         f', and at most {max_pixels} pixels in all')
    row = width * layout.channels * np.dtype(layout.dtype).itemsize
    if step < row:
        raise ImageError(Reason.STEP_TOO_SMALL, f'{what}: step is {step}, must be at least {row}')
    if size < step * height:
        raise ImageError(Reason.DATA_TOO_SHORT, f'{what}: holds {size} bytes, must be at least '
                         f'step x height = {step} x {height} = {step * height}')
