"""
What encoded images claim of their size, read from their first bytes alone.

A decoder must not find another size than is read here, or few bytes could still claim gigabytes:
what one reader may take so and another one so is not read at all.
"""
from __future__ import annotations

import re
import struct
from typing import Callable

JPEG_START, PNG_START = b'\xff\xd8', b'\x89PNG\r\n\x1a\n'
JPEG_SCAN = b'\xff\xda'
# Start-of-frame markers of a JPEG; C4, C8 and CC between them mean something else.
JPEG_FRAMES = frozenset(range(0xc0, 0xd0)) - {0xc4, 0xc8, 0xcc}
JPEG_ALONE = frozenset({0x01, *range(0xd0, 0xd9)})  # markers of segments without a length
JPEG_FIRST = 0xc0   # of the markers that have a meaning, but for TEM
# Some readers take a number's sign for a comment along with the number.
BLANK = rb'(?:\s|#[^\r\n]*[\r\n])'
PNM = re.compile(rb'P[1-6]%b+(\d{1,9})\s%b*(\d{1,9})\s' % (BLANK, BLANK))
PNM_WHITE = re.compile(rb'%b*(\d{1,9})\s' % BLANK)
TIFF_WIDTH, TIFF_HEIGHT = 256, 257  # tags
TIFF_FORMATS = {3: 'H', 4: 'I'}  # types of their values

FORMATS = 'BMP, JPEG, PBM, PGM, PNG, PPM, TIFF, WebP'

Size = tuple[int, int]


def size(data: bytes) -> Size | None:
    """
    Return width and height, px, that an image claims.

    ``data`` is the whole of the file.  None where it is in none of :data:`FORMATS`, or does not
    tell.
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
    Return how often a decoder goes over all pixels of an image at most.

    Progressive JPEGs are sent in scans, and a scan of all pixels can be a few bytes.
    """
    return data.count(JPEG_SCAN) if data.startswith(JPEG_START) else 1


def white(data: bytes) -> int | None:
    """Return the value that a PGM or PPM of 16 bits says is white; None of any other image."""
    size = PNM.match(data)
    found = PNM_WHITE.match(data, size.end()) if size and data[1:2] in b'2356' else None
    return int(found[1]) if found and int(found[1]) > 255 else None


def _png(data: bytes) -> Size | None:
    # OpenCV 5 makes room for as much as a chunk claims to hold, up to 4 GB.
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
            at += 1  # a byte of filling
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
    return abs(width), abs(height)  # a height below 0 has its rows from the top


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
