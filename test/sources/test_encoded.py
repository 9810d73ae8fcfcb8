"""No encoded image, however made, is decoded at another size or cost than was looked at before."""
from __future__ import annotations

import struct

import cv2
from hypothesis import given, strategies as st
import numpy as np
import pytest
from qflsd_ros.sources import headers
from qflsd_ros.sources.encoded import decode, DecodingError
from qflsd_ros.sources.files import IMAGE_SUFFIXES

SMOOTH = np.add.outer(4 * np.arange(12), 3 * np.arange(16)).astype(np.uint8)
COLOUR = np.dstack([SMOOTH, SMOOTH // 2, SMOOTH])
GRAY = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
TIFF_KIND = b'\x01\x03\x00\x01\x00\x00\x00'
TOKENS = [
    b'#', b'\r', b'\n', b' ', b'0', b'9', b'\0', b'\xff', b'\xff\0', b'\xff\xc0', b'\xff\xc2',
    b'\xff\xd9', b'\xff\xda', b'\xff\xfe\0\2', b'IHDR', b'IDAT', b'IEND', b'VP8X', b'VP8L',
    b'\0' + TIFF_KIND, b'\1' + TIFF_KIND]


def encoded(suffix: str, *options: int) -> bytes:
    pixels = SMOOTH if suffix in ('.pgm', '.pbm') else COLOUR
    suffix = '.jpg' if suffix == '.jfif' else suffix    # which OpenCV has no name for
    return cv2.imencode(suffix, pixels, options)[1].tobytes()


PNG, JPEG, TIFF = (encoded(suffix) for suffix in ('.png', '.jpg', '.tiff'))
PROGRESSIVE = encoded('.jpg', cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
FILES = [*(encoded(suffix) for suffix in IMAGE_SUFFIXES), PROGRESSIVE,
         encoded('.webp', cv2.IMWRITE_WEBP_QUALITY, 50), b'P2\n# c\n16 12\n255\n' + b'7 ' * 192]


def decoded_size(data: bytes) -> tuple[int, ...] | None:
    """Return the size at which an image is decoded; None where it is refused."""
    try:
        return decode(data, GRAY, 'it').shape[::-1]
    except DecodingError:
        return None


def tiff_with(tag: int, kind: int, value: int) -> bytes:
    """Return a TIFF that has one tag more, the last one."""
    at, = struct.unpack_from('<I', TIFF, 4)
    count, = struct.unpack_from('<H', TIFF, at)
    entries = TIFF[at + 2:at + 2 + 12 * count] + struct.pack('<HHII', tag, kind, 1, value)
    return (TIFF[:4] + struct.pack('<I', len(TIFF)) + TIFF[8:] + struct.pack('<H', count + 1)
            + entries + bytes(4))


def jpeg_of_two_sizes() -> bytes:
    """Return a JPEG with a false frame where a marker that is none seems to lead."""
    at = JPEG.index(b'\xff\xc0')
    data = JPEG[:at] + b'\xff\0' + JPEG[at:]
    return data.ljust(at + 2 + 0xffc0, b'\0') + b'\xff\xc0\0\x0b\x08\0\3\0\5\1' + bytes(20)


@pytest.mark.parametrize('data', [
    b'P5\n#\r40 30\n16\n12 255\n' + bytes(1200),        # is the comment over?
    b'P5\n16#40 3\n12 255\n' + bytes(640),              # is it one?
    b'P5 16 00000000012 255\n' + bytes(192),
    jpeg_of_two_sizes(),
    *(tiff_with(tag, kind, 3) for tag in (headers.TIFF_WIDTH, headers.TIFF_HEIGHT)
      for kind in (1, 3, 4, 16)),
], ids=range(12))
def test_what_claims_two_sizes(data: bytes) -> None:
    """One or the other is decoded; the same is looked at, or the image is refused."""
    assert cv2.imdecode(np.frombuffer(data, np.uint8), GRAY) is not None
    assert decoded_size(data) in (None, headers.size(data))


@given(st.sampled_from(FILES), st.lists(st.tuples(
    st.integers(0, 40) | st.integers(0, 400), st.integers(0, 8),
    st.sampled_from(TOKENS) | st.binary(max_size=12)), min_size=1, max_size=3))
def test_files_with_some_bytes_exchanged(data: bytes, edits: list[tuple[int, int, bytes]]) -> None:
    for at, gone, other in edits:
        data = data[:at] + other + data[at + gone:]
    assert decoded_size(data) in (None, headers.size(data))


@pytest.mark.parametrize('length', [3, 1000, 0xedededed])
@pytest.mark.parametrize('kind', [b'IDAT', b'tEXt', b'IEND'])
def test_a_chunk_of_a_png_that_claims_more_than_there_is(kind: bytes, length: int) -> None:
    """It is not decoded: room would be made for all of it."""
    data = PNG[:33] + struct.pack('>I', length) + kind + b'abcdef'
    with pytest.raises(DecodingError, match='damaged') as caught:
        decode(data, GRAY, 'it')
    assert caught.value.reason == 'cannot be decoded' and headers.size(data) is None


def test_more_behind_a_png() -> None:
    assert decoded_size(PNG + b'more') == (16, 12)


def test_scans_are_bounded_by_the_size_of_the_image() -> None:
    """Each goes over all pixels, and takes some bytes only."""
    at, scans = PROGRESSIVE.index(b'\xff\xc2') + 5, PROGRESSIVE.index(b'\xff\xda')
    data = PROGRESSIVE[:-2] + 100 * PROGRESSIVE[scans:-2] + b'\xff\xd9'
    assert decoded_size(data) == (16, 12)
    large = data[:at] + struct.pack('>HH', 8000, 8000) + data[at + 4:]
    with pytest.raises(DecodingError, match='1010 scans of 8000 x 8000.*at most 67') as caught:
        decode(large, GRAY, 'it')
    assert caught.value.reason == 'too many scans'
