"""Image files as sources: one, or a folder of them."""
from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re

import numpy as np

from qflsd_ros.sources.encoded import COLOUR, decode_eight_bits, DecodingError, GRAY
from qflsd_ros.sources.frames import Frame, Report, Source, SourceError

IMAGE_SUFFIXES = ('.bmp', '.dib', '.jfif', '.jpe', '.jpeg', '.jpg', '.pbm', '.pgm', '.png', '.pnm',
                  '.ppm', '.tif', '.tiff', '.webp')
MAX_BYTES = 1 << 30     # the largest image, MAX_PIXELS, of four values of 16 bits each


class Images(Source):
    """Image files in a given order, as mono8 or bgr8; those that cannot be read are skipped."""

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
    """Return the source of one image file; SourceError where it cannot be read."""
    read_image(path, colour)
    return Images(repr(str(path)), [path], colour, report)


def open_folder(folder: Path, colour: bool, report: Report) -> Images:
    """
    Return the source of a folder's image files in natural order: frame2 comes before frame10.

    Raises
    ------
    SourceError
        The folder cannot be read or holds no image file.

    """
    try:
        paths = [path for path in folder.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES]
    except OSError as error:
        raise SourceError(f'{str(folder)!r}: {error.strerror}') from error
    if not paths:
        raise SourceError(f'{str(folder)!r}: no image in this folder: its files must end in '
                          f'{", ".join(IMAGE_SUFFIXES)}, or be a rosbag2 with its metadata.yaml')
    return Images(repr(str(folder)), sorted(paths, key=natural_order), colour, report)


def natural_order(path: Path) -> list[tuple[int, str]]:
    """Return a key that sorts the numbers in file names by value."""
    return [(int(part), '') if part.isdecimal() else (-1, part)
            for part in re.split(r'(\d+)', path.name)]


def read_image(path: Path, colour: bool, white_level: float | None = None) -> np.ndarray:
    """
    Read an image as the sensor saw it, (H, W) or in colour (H, W, 3) B, G, R uint8.

    ``white_level`` is that of :func:`qflsd_ros.sources.encoded.decode_eight_bits`.
    """
    flags = COLOUR if colour else GRAY
    try:
        return decode_eight_bits(read_file(path), flags, repr(str(path)), white_level)
    except DecodingError as error:
        raise SourceError(str(error)) from error


def read_file(path: Path) -> bytes:
    """Return what a file of at most MAX_BYTES holds; SourceError where that cannot be read."""
    check_file(path)
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise SourceError(f'{str(path)!r}: has {size} bytes: must have at most {MAX_BYTES}')
        with path.open('rb') as file:
            return file.read(size)  # and no more, whatever is appended meanwhile
    except OSError as error:
        raise SourceError(f'{str(path)!r}: {error.strerror}') from error


def check_file(path: Path) -> None:
    """Raise SourceError where a path is no file: reading a pipe or a device might never end."""
    try:
        path.stat()
    except OSError as error:
        raise SourceError(f'{str(path)!r}: {error.strerror}') from error
    if not path.is_file():
        raise SourceError(f'{str(path)!r}: is no file')


def encoding(colour: bool) -> str:
    """Return the encoding of images read with or without colour."""
    return 'bgr8' if colour else 'mono8'
