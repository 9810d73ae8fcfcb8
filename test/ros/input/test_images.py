"""Every encoding gives the right grey values, and errors name their cause."""
from __future__ import annotations

from array import array

from hypothesis import given, strategies as st
import numpy as np
import pytest
from qflsd_ros.ros.input import images
from sensor_msgs.msg import Image

GRAY = np.random.default_rng(0).integers(0, 256, (24, 32), np.uint8)
COLOUR = np.random.default_rng(1).integers(0, 256, (24, 32, 3), np.uint8)
# ITU-R BT.601, as everybody turns colour to grey.
LUMA = np.rint(COLOUR @ np.array([0.114, 0.587, 0.299])).astype(np.uint8)
OPAQUE = np.full((24, 32, 1), 255, np.uint8)
SMOOTH = np.add.outer(4 * np.arange(24), 3 * np.arange(32)).astype(np.uint8)


def image(encoding: str, pixels: np.ndarray, padding: int = 0, big: bool = False) -> Image:
    """Return a message with rows of pixels, each followed by some bytes of padding."""
    pixels = pixels.astype(pixels.dtype.newbyteorder('>' if big else '<'))
    height, width = pixels.shape[:2]
    rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, -1)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=99)
    return Image(encoding=encoding, height=height, width=width, step=rows.shape[1],
                 is_bigendian=big, data=array('B', rows.tobytes()))


def interleaved(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.stack([first, second], axis=-1)


@pytest.mark.parametrize('padding', [0, 1, 16])
@pytest.mark.parametrize('encoding, pixels, gray', [
    ('mono8', GRAY, GRAY),
    ('8UC1', GRAY, GRAY),
    ('bgr8', COLOUR, LUMA),
    ('rgb8', COLOUR[..., ::-1], LUMA),
    ('bgra8', np.dstack([COLOUR, OPAQUE]), LUMA),
    ('rgba8', np.dstack([COLOUR[..., ::-1], OPAQUE]), LUMA),
    ('uyvy', interleaved(255 - GRAY, GRAY), GRAY),
    ('yuv422', interleaved(255 - GRAY, GRAY), GRAY),
    ('yuyv', interleaved(GRAY, 255 - GRAY), GRAY),
    ('yuv422_yuy2', interleaved(GRAY, 255 - GRAY), GRAY),
    ('nv12', GRAY, GRAY),
    ('nv21', GRAY, GRAY),
    ('nv24', GRAY, GRAY),
    ('32FC1', GRAY.astype(np.float32) / 255, GRAY),
])
def test_encodings(encoding: str, pixels: np.ndarray, gray: np.ndarray, padding: int) -> None:
    result = images.read(image(encoding, pixels, padding))
    assert result.dtype == np.uint8 and result.shape == gray.shape
    assert np.abs(result.astype(int) - gray).max() <= (1 if gray is LUMA else 0)


@pytest.mark.parametrize('big', [False, True])
@pytest.mark.parametrize('encoding, pixels, gray', [
    ('mono16', GRAY * np.uint16(257), GRAY),
    ('16UC1', GRAY * np.uint16(257), GRAY),
    ('bgr16', COLOUR * np.uint16(257), LUMA),
    ('rgb16', COLOUR[..., ::-1] * np.uint16(257), LUMA),
    ('bgra16', np.dstack([COLOUR, OPAQUE]) * np.uint16(257), LUMA),
    ('rgba16', np.dstack([COLOUR[..., ::-1], OPAQUE]) * np.uint16(257), LUMA),
    ('32FC1', GRAY.astype(np.float32) / 255, GRAY),
])
def test_byte_order(encoding: str, pixels: np.ndarray, gray: np.ndarray, big: bool) -> None:
    result = images.read(image(encoding, pixels, 3, big))
    assert np.abs(result.astype(int) - gray).max() <= (1 if gray is LUMA else 0)


@pytest.mark.parametrize('depth', [8, 16])
@pytest.mark.parametrize('pattern', ['rggb', 'bggr', 'gbrg', 'grbg'])
def test_bayer(pattern: str, depth: int) -> None:
    """The Bayer mosaic of a smooth coloured image gives the luma of that image."""
    shares = {'r': 0.4, 'g': 1.0, 'b': 0.7}
    mosaic = np.empty_like(SMOOTH)
    for i, letter in enumerate(pattern):
        corner = np.s_[i // 2::2, i % 2::2]
        mosaic[corner] = np.rint(SMOOTH[corner] * shares[letter])
    expected = SMOOTH * (0.299 * shares['r'] + 0.587 * shares['g'] + 0.114 * shares['b'])
    pixels = mosaic if depth == 8 else mosaic * np.uint16(257)
    result = images.read(image(f'bayer_{pattern}{depth}', pixels))
    assert np.abs(result - expected)[2:-2, 2:-2].max() <= 3


def test_mono8_is_not_copied() -> None:
    message = image('mono8', GRAY, 7)
    gray = images.read(message)
    assert gray.strides == (39, 1)
    message.data[2 * 39 + 5] = 255 - message.data[2 * 39 + 5]
    assert gray[2, 5] == 255 - GRAY[2, 5]


@pytest.mark.parametrize('encoding, value, white, gray', [
    ('mono16', 2047, 4095, 127), ('mono16', 5000, 4095, 255), ('mono16', 65535, 0, 255),
    ('32FC1', 0.5, 0, 128), ('32FC1', 5.0, 10.0, 128), ('32FC1', -5.0, 10.0, 0),
    ('32FC1', np.nan, 0, 0), ('32FC1', np.inf, 0, 255), ('32FC1', -np.inf, 0, 0)])
def test_white_level(encoding: str, value: float, white: float, gray: int) -> None:
    dtype = np.uint16 if encoding == 'mono16' else np.float32
    assert images.read(image(encoding, np.full((2, 2), value, dtype)), white).tolist() == \
        [[gray, gray], [gray, gray]]


@pytest.mark.parametrize('changes, reason, texts', [
    ({'encoding': 'bgr9'}, 'unknown encoding', ["'bgr9'", 'mono8', 'bayer_rggb8']),
    ({'width': 0}, 'wrong size', ['0 x 24', '1 to 32768']),
    ({'height': 0}, 'wrong size', ['32 x 0', '1 to 32768']),
    ({'height': 32769}, 'wrong size', ['32 x 32769', '1 to 32768']),
    ({'height': 30000, 'width': 30000}, 'wrong size', ['at most 134217728 pixels']),
    ({'encoding': 1000000 * 'e'}, 'unknown encoding', ["'eee", 'yuyv']),
    ({'step': 31}, 'step too small', ['step is 31', 'at least 32']),
    ({'step': 33}, 'data too short', ['768 bytes', '33 x 24 = 792']),
    ({'data': array('B')}, 'data too short', ['0 bytes', '32 x 24 = 768']),
])
def test_what_does_not_fit_is_named(changes: dict, reason: str, texts: list[str]) -> None:
    message = image('mono8', GRAY)
    for name, value in changes.items():
        setattr(message, name, value)
    with pytest.raises(images.ImageError) as caught:
        images.read(message)
    assert caught.value.reason == reason
    assert all(text in str(caught.value) for text in texts), str(caught.value)
    assert len(str(caught.value)) <= 1200


def test_max_pixels() -> None:
    assert images.read(image('mono8', GRAY), 0.0, 24 * 32).shape == (24, 32)
    with pytest.raises(images.ImageError, match='at most 767 pixels'):
        images.read(image('mono8', GRAY), 0.0, 24 * 32 - 1)


@given(encoding=st.sampled_from([*images.LAYOUTS, '', 'jpeg']), height=st.integers(0, 9),
       width=st.integers(0, 9), step=st.integers(0, 99), big=st.integers(0, 255),
       data=st.binary(max_size=999), white=st.floats(0, 1e6))
def test_any_message_gives_a_frame_or_an_image_error(
        encoding: str, height: int, width: int, step: int, big: int, data: bytes,
        white: float) -> None:
    message = Image(encoding=encoding, height=height, width=width, step=step, is_bigendian=big,
                    data=array('B', data))
    try:
        gray = images.read(message, white)
    except images.ImageError:
        return
    assert gray.shape == (height, width) and gray.dtype == np.uint8
