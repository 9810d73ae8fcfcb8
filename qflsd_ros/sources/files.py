"""Image files as sources: a single file, or a folder of images."""
from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re

import numpy as np

from qflsd_ros.sources.encoded import COLOUR, decode_eight_bits, DecodingError, GRAY
from qflsd_ros.sources.frames import Frame, Report, Source, SourceError

IMAGE_SUFFIXES = ('.bmp', '.dib', '.jfif', '.jpe', '.jpeg', '.jpg', '.pbm', '.pgm', '.png', '.pnm',
                  '.ppm', '.tif', '.tiff', '.webp')
MAX_BYTES = 1 << 30     # the largest image, of MAX_PIXELS with four channels of 16 bits


class Images(Source):
    """Image files in the given order, as mono8 or bgr8; unreadable files are skipped."""

    def __init__(self, name: str, paths: list[Path], colour: bool, report: Report) -> None:
        super().__init__(name, report)
        self._paths, self._colour = paths, colour

    def _frames(self) -> Iterator[Frame]:
        for path in self._paths:
            try:
                yield Frame.of(read_image(path, self._colour), encoding(self._colour), path.name)
            except SourceError as error:
                self._skip(str(error))


def open_image(path: Path, colour: bool, report: Report) -> Images:
    """Open a single image file; SourceError if it cannot be read."""
    read_image(path, colour)
    return Images(repr(str(path)), [path], colour, report)


def open_folder(folder: Path, colour: bool, report: Report) -> Images:
    """
    Open the image files of a folder in natural order: frame2 comes before frame10.

    Raises
    ------
    SourceError
        The folder cannot be read or has no image file.

    """
    paths = list_files(folder, IMAGE_SUFFIXES)
    if not paths:
        raise SourceError(f'{str(folder)!r}: no image in this folder: its files must end in '
                          f'{", ".join(IMAGE_SUFFIXES)}, or be a rosbag2 with its metadata.yaml')
    return Images(repr(str(folder)), paths, colour, report)


def list_files(folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """
    Return the entries of a folder that have one of the suffixes, in natural order.

    Suffixes are in lower case and match in any case.  A folder that cannot be read raises
    SourceError.
    """
    try:
        paths = [path for path in folder.iterdir() if path.suffix.lower() in suffixes]
    except OSError as error:
        raise SourceError(f'{str(folder)!r}: {error.strerror}') from error
    return sorted(paths, key=natural_order)


def natural_order(path: Path) -> list[tuple[int, str]]:
    """Return a sort key by which the numbers in file names are in order of their value."""
    return [(int(part), '') if part.isdecimal() else (-1, part)
            for part in re.split(r'(\d+)', path.name)]


def read_image(path: Path, colour: bool, white_level: float | None = None) -> np.ndarray:
    """
    Read an image file: (H, W) uint8, or in colour (H, W, 3) B, G, R uint8.

    An orientation tag is ignored, so that coordinates are those of the sensor.  ``white_level`` is
    that of :func:`qflsd_ros.sources.encoded.decode_eight_bits`.  An unreadable file raises
    SourceError.
    """
    flags = COLOUR if colour else GRAY
    try:
        return decode_eight_bits(read_file(path), flags, repr(str(path)), white_level)
    except DecodingError as error:
        raise SourceError(str(error)) from error


def read_file(path: Path) -> bytes:
    """Return the content of a file; SourceError if it is unreadable or above MAX_BYTES."""
    check_file(path)
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise SourceError(f'{str(path)!r}: has {size} bytes: must have at most {MAX_BYTES}')
        with path.open('rb') as file:
            return file.read(size)  # no more, even if the file grows meanwhile
    except OSError as error:
        raise SourceError(f'{str(path)!r}: {error.strerror}') from error


def check_file(path: Path) -> None:
    """Raise SourceError unless a path is a regular file: a pipe or device might never end."""
    try:
        path.stat()
    except OSError as error:
        raise SourceError(f'{str(path)!r}: {error.strerror}') from error
    if not path.is_file():
        raise SourceError(f'{str(path)!r}: is no file')


def encoding(colour: bool) -> str:
    """Return the encoding of images that are read in colour, or else in grey."""
    return 'bgr8' if colour else 'mono8'
