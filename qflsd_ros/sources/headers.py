"""
The size of encoded images, read from their headers.

The size must be the one that the decoder finds, or else a few bytes could still claim gigabytes.
An image that two readers could understand differently is therefore refused: its size is None.
"""
from __future__ import annotations

import re
import struct
from typing import Callable

JPEG_START, PNG_START = b'\xff\xd8', b'\x89PNG\r\n\x1a\n'
JPEG_SCAN = b'\xff\xda'
# Start-of-frame markers of a JPEG; C4, C8 and CC in that range have other meanings.
JPEG_FRAMES = frozenset(range(0xc0, 0xd0)) - {0xc4, 0xc8, 0xcc}
JPEG_ALONE = frozenset({0x01, *range(0xd0, 0xd9)})  # markers of segments without a length
JPEG_FIRST = 0xc0   # first marker with a meaning, except for TEM (01)
# A comment directly behind a number is not matched, since readers treat it differently.
BLANK = rb'(?:\s|#[^\r\n]*[\r\n])'
PNM = re.compile(rb'P[1-6]%b+(\d{1,9})\s%b*(\d{1,9})\s' % (BLANK, BLANK))
PNM_WHITE = re.compile(rb'%b*(\d{1,9})\s' % BLANK)
TIFF_WIDTH, TIFF_HEIGHT = 256, 257  # tags
TIFF_FORMATS = {3: 'H', 4: 'I'}  # types of their values

FORMATS = 'BMP, JPEG, PBM, PGM, PNG, PPM, TIFF, WebP'

Size = tuple[int, int]


def size(data: bytes) -> Size | None:
    """
    Return width and height in the header of an image, px.

    ``data`` is the complete file.  The result is None if the format is not one of
    :data:`FORMATS`, or the header is damaged.
    """
    for start, read in READERS.items():
        if data.startswith(start):
            try:
                return read(data)
            except struct.error:
                return None
    return None


def passes(data: bytes) -> int:
    """
    Return an upper bound of how often a decoder writes each pixel.

    A progressive JPEG consists of scans, and a scan of all pixels can have only a few bytes.
    """
    return data.count(JPEG_SCAN) if data.startswith(JPEG_START) else 1


def white(data: bytes) -> int | None:
    """Return the maximum in the header of a 16-bit PGM or PPM; None for other images."""
    size = PNM.match(data)
    found = PNM_WHITE.match(data, size.end()) if size and data[1:2] in b'2356' else None
    return int(found[1]) if found and int(found[1]) > 255 else None


def _png(data: bytes) -> Size | None:
    # All chunks must be complete: OpenCV 5 allocates the length that a chunk claims, up to 4 GB.
    at, kind = len(PNG_START), b''
    while kind != b'IEND':
        length, kind = struct.unpack_from('>I4s', data, at)
        at += length + 12
    return struct.unpack_from('>II', data, 16) if at <= len(data) else None


def _jpeg(data: bytes) -> Size | None:
    at = len(JPEG_START)
    while at + 9 <= len(data) and data[at] == 0xff:
        marker = data[at + 1]
        if marker in JPEG_FRAMES:
            height, width = struct.unpack_from('>HH', data, at + 5)
            return width, height
        if marker == 0xff:
            at += 1  # any number of bytes ff may precede a marker
        elif marker in JPEG_ALONE:
            at += 2
        elif marker < JPEG_FIRST:
            return None
        else:
            at += 2 + struct.unpack_from('>H', data, at + 2)[0]
    return None


def _bmp(data: bytes) -> Size:
    old = struct.unpack_from('<I', data, 14)[0] == 12
    width, height = struct.unpack_from('<HH' if old else '<ii', data, 18)
    return abs(width), abs(height)  # a height below 0 means that the first row is the top one


def _pnm(data: bytes) -> Size | None:
    found = PNM.match(data)
    return (int(found[1]), int(found[2])) if found else None


def _tiff(data: bytes) -> Size | None:
    order = '<' if data[:1] == b'I' else '>'
    at, = struct.unpack_from(f'{order}I', data, 4)
    count, = struct.unpack_from(f'{order}H', data, at)
    values = {}
    for entry in range(at + 2, at + 2 + 12 * count, 12):
        tag, kind, numbers = struct.unpack_from(f'{order}HHI', data, entry)
        if tag in (TIFF_WIDTH, TIFF_HEIGHT):
            if tag in values or kind not in TIFF_FORMATS or numbers != 1:
                return None
            values[tag], = struct.unpack_from(order + TIFF_FORMATS[kind], data, entry + 8)
    return (values[TIFF_WIDTH], values[TIFF_HEIGHT]) if len(values) == 2 else None


def _webp(data: bytes) -> Size | None:
    kind = data[8:16]
    if kind == b'WEBPVP8 ':
        width, height = struct.unpack_from('<HH', data, 26)
        return width & 0x3fff, height & 0x3fff
    if kind == b'WEBPVP8L':
        bits, = struct.unpack_from('<I', data, 21)
        return (bits & 0x3fff) + 1, (bits >> 14 & 0x3fff) + 1
    if kind == b'WEBPVP8X':
        low, middle, high = struct.unpack_from('<HHH', data, 24)
        return (low | (middle & 0xff) << 16) + 1, (middle >> 8 | high << 8) + 1
    return None


READERS: dict[bytes, Callable[[bytes], Size | None]] = {
    JPEG_START: _jpeg, PNG_START: _png, b'BM': _bmp, b'II*\0': _tiff, b'MM\0*': _tiff,
    b'RIFF': _webp, **{b'P%d' % number: _pnm for number in range(1, 7)}}
