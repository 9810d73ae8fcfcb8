"""The size that an image claims is read without decoding it, in every format that is read."""
from __future__ import annotations

import struct

import cv2
from hypothesis import given, strategies as st
import numpy as np
import pytest
from qflsd_ros.sources import headers
from qflsd_ros.sources.files import IMAGE_SUFFIXES
from qflsd_ros.sources.headers import size

SMOOTH = np.add.outer(4 * np.arange(24), 3 * np.arange(32)).astype(np.uint8)
COLOUR = np.dstack([SMOOTH, SMOOTH // 2, SMOOTH])
JPEG = cv2.imencode('.jpg', SMOOTH)[1].tobytes()


def encoded(suffix: str, pixels: np.ndarray) -> bytes:
    """Return an image as a file; some formats hold grey or colour alone."""
    if suffix in ('.pgm', '.pbm') and pixels.ndim == 3:
        pixels = np.ascontiguousarray(pixels[..., 0])
    if suffix == '.ppm' and pixels.ndim == 2:
        pixels = np.dstack([pixels] * 3)
    suffix = '.jpg' if suffix == '.jfif' else suffix    # which OpenCV has no name for
    return cv2.imencode(suffix, pixels)[1].tobytes()


FILES = [encoded(suffix, SMOOTH) for suffix in IMAGE_SUFFIXES]


@pytest.mark.parametrize('suffix', IMAGE_SUFFIXES)
@pytest.mark.parametrize('pixels', [SMOOTH, COLOUR, COLOUR[:1, :7], COLOUR.repeat(30, 0)])
def test_every_format(suffix: str, pixels: np.ndarray) -> None:
    assert size(encoded(suffix, pixels)) == pixels.shape[1::-1]


@pytest.mark.parametrize('options', [
    [], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_RST_INTERVAL, 2],
    [cv2.IMWRITE_JPEG_OPTIMIZE, 1]])
def test_every_kind_of_jpeg(options: list[int]) -> None:
    data = cv2.imencode('.jpg', SMOOTH, options)[1].tobytes()
    assert size(data) == (32, 24)
    filled = data[:2] + b'\xff\xff' + data[2:]
    assert size(filled) == (32, 24)
    comment = data[:2] + b'\xff\xfe' + struct.pack('>H', 6) + b'\xff\xc0ab' + data[2:]
    assert size(comment) == (32, 24)
    assert cv2.imdecode(np.frombuffer(comment, np.uint8), 0).shape == (24, 32)


@pytest.mark.parametrize('quality', [50, 101])
@pytest.mark.parametrize('opaque', [True, False])
def test_every_kind_of_webp(quality: int, opaque: bool) -> None:
    """With losses and without, with an alpha channel and without."""
    pixels = COLOUR if opaque else np.dstack([COLOUR, SMOOTH])
    data = cv2.imencode('.webp', pixels, [cv2.IMWRITE_WEBP_QUALITY, quality])[1].tobytes()
    assert size(data) == (32, 24)


def test_sixteen_bits_comments_and_the_other_byte_order() -> None:
    assert size(cv2.imencode('.tiff', COLOUR * np.uint16(257))[1].tobytes()) == (32, 24)
    assert size(b'P5 # 7 8\n#9\n 32\n24 255\n') == (32, 24)
    entries = struct.pack('>HHHII', 2, 256, 4, 1, 32) + struct.pack('>HHIHH', 257, 3, 1, 24, 0)
    assert size(b'MM\0*' + struct.pack('>I', 8) + entries) == (32, 24)
    assert size(b'BM' + bytes(12) + struct.pack('<Iii', 40, 32, -24)) == (32, 24)
    assert size(b'BM' + bytes(12) + struct.pack('<IHH', 12, 32, 24)) == (32, 24)


@pytest.mark.parametrize('data', [b'', b'no image', JPEG[:60], JPEG[:3], b'RIFFxxxxWAVEfmt '])
def test_what_does_not_tell(data: bytes) -> None:
    assert size(data) is None


@given(start=st.sampled_from([*FILES, *headers.READERS, b'RIFFxxxxWEBPVP8X']),
       cut=st.integers(0, 2000), at=st.integers(0, 300), other=st.binary(max_size=40))
def test_any_data_gives_a_size_or_none(start: bytes, cut: int, at: int, other: bytes) -> None:
    data = (start[:at] + other + start[at + len(other):])[:cut]
    found = size(data)
    assert found is None or all(isinstance(side, int) and side >= 0 for side in found)
