"""JPEG and PNG are decoded, unless they are damaged or too large."""
from __future__ import annotations

from array import array
import struct
import tracemalloc
import zlib

import cv2
from hypothesis import given, strategies as st
import numpy as np
import pytest
from qflsd_ros.ros.input import compressed, images
from qflsd_ros.sources.encoded import DecodingError
from qflsd_ros.sources.headers import size
from sensor_msgs.msg import CompressedImage, Image

SMOOTH = np.add.outer(4 * np.arange(24), 3 * np.arange(32)).astype(np.uint8)
PNG, JPEG = (cv2.imencode(extension, SMOOTH)[1].tobytes() for extension in ('.png', '.jpg'))


def message(data: bytes) -> CompressedImage:
    return CompressedImage(format='whatever', data=array('B', data))


def png_of(width: int, height: int) -> bytes:
    """Return a small PNG that declares a given size."""
    header = b'IHDR' + struct.pack('>II', width, height) + PNG[24:29]
    return PNG[:12] + header + struct.pack('>I', zlib.crc32(header)) + PNG[33:]


def jpeg_of(width: int, height: int) -> bytes:
    """Return a small JPEG that declares a given size."""
    at = JPEG.index(b'\xff\xc0')
    return JPEG[:at + 5] + struct.pack('>HH', height, width) + JPEG[at + 9:]


@pytest.mark.parametrize('extension', ['.png', '.jpg'])
@pytest.mark.parametrize('pixels', [SMOOTH, np.dstack([SMOOTH] * 3)])
def test_images_are_decoded(extension: str, pixels: np.ndarray) -> None:
    data = cv2.imencode(extension, pixels)[1].tobytes()
    gray = compressed.decode(message(data))
    assert gray.dtype == np.uint8 and gray.shape == SMOOTH.shape
    assert np.abs(gray.astype(int) - SMOOTH).max() <= 4


@pytest.mark.parametrize('channels', [1, 3, 4])
@pytest.mark.parametrize('bits', [10, 12, 16])
def test_16_bits_are_scaled_as_those_of_raw_images(bits: int, channels: int) -> None:
    """For 10 bits in a PNG of 16 bits, white_level has the same effect as for mono16."""
    white = 2 ** bits - 1
    values = np.rint(SMOOTH * (white / 255)).astype(np.uint16)
    pixels = np.dstack([values] * channels)
    found = compressed.decode(message(cv2.imencode('.png', pixels)[1].tobytes()), white)
    raw = images.read(Image(
        encoding='mono16', height=24, width=32, step=64, data=array('B', values.tobytes())), white)
    assert np.abs(found.astype(int) - SMOOTH).max() <= 1
    assert np.abs(found.astype(int) - raw).max() <= (0 if channels == 1 else 1)


def test_white_level_leaves_8_bits_alone() -> None:
    for data in (PNG, JPEG):
        assert np.array_equal(compressed.decode(message(data), 1023.0),
                              cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE))


def test_max_pixels_is_kept_before_anything_is_decoded() -> None:
    data = message(png_of(1000, 1000))
    with pytest.raises(DecodingError, match='at most 999999 pixels') as caught:
        compressed.decode(data, 0.0, 999_999)
    assert caught.value.reason == 'wrong size'
    with pytest.raises(DecodingError) as caught:
        compressed.decode(data, 0.0, 1_000_000)
    assert caught.value.reason == 'cannot be decoded'


@pytest.mark.parametrize('data', [
    b'', b'no image', PNG[:40], JPEG[:100], PNG[:20], JPEG[:3],
    cv2.imencode('.bmp', SMOOTH)[1].tobytes()])
def test_corrupt_data_is_named(data: bytes) -> None:
    with pytest.raises(DecodingError, match=f'{len(data)} bytes') as caught:
        compressed.decode(message(data))
    assert caught.value.reason == 'cannot be decoded'


@pytest.mark.parametrize('width, height', [
    (32769, 1), (1, 40000), (30000, 30000), (0, 5), (65535, 65535)])
@pytest.mark.parametrize('claiming', [png_of, jpeg_of])
def test_what_is_too_large_is_refused_before_it_is_decoded(claiming, width: int,
                                                           height: int) -> None:
    assert size(claiming(32, 24)) == (32, 24)
    tracemalloc.start()
    with pytest.raises(DecodingError, match=f'has {width} x {height} pixels: both must') as caught:
        compressed.decode(message(claiming(width, height)))
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()
    assert caught.value.reason == 'wrong size'


@given(start=st.sampled_from([PNG, JPEG, b'\xff\xd8', b'']), cut=st.integers(0, 2000),
       at=st.integers(0, 700), other=st.binary(max_size=20))
def test_any_data_gives_a_frame_or_a_decoding_error(start: bytes, cut: int, at: int,
                                                    other: bytes) -> None:
    data = (start[:at] + other + start[at + len(other):])[:cut]
    try:
        gray = compressed.decode(message(data))
    except DecodingError:
        return
    assert gray.ndim == 2 and gray.dtype == np.uint8
