"""The pictures to work on: how the files of the command line are read, named and numbered."""
from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
import os
from pathlib import Path
from typing import Iterable, Iterator, NamedTuple
import unicodedata

import cv2
import numpy as np
from qflsd_ros.ros.input import images
from qflsd_ros.sources.bag import Bag
from qflsd_ros.sources.encoded import GRAY
from qflsd_ros.sources.files import read_image
from qflsd_ros.sources.frames import Frame, Report, report_by_log, SourceError
from qflsd_ros.sources.opening import expand, Kind, kind_of
from qflsd_ros.sources.video import quiet_capture, Video


class Moment(NamedTuple):
    """When a recorded image was recorded and taken (ns), and its coordinate frame."""

    recorded: int
    stamp: int
    frame_id: str


@dataclass(frozen=True)
class Picture:
    """
    A picture to work on: an image file, or a frame of a video or rosbag2.

    Attributes
    ----------
    path
        The file that the picture comes from.
    name
        The name of its results, unique among all pictures.
    frame
        Number of the frame in a video or rosbag2, from 0; None for an image file.
    pixels
        (H, W, 3) uint8 B, G, R of a frame of a video; None for other pictures, which
        :meth:`read` reads.
    message
        The recorded image of a rosbag2; None for other pictures.
    moment
        The times of an image of a rosbag2; None for other pictures.

    """

    path: Path
    name: str
    frame: int | None = None
    pixels: np.ndarray | None = None
    message: Frame | None = None
    moment: Moment | None = None

    def read(self, white_level: float | None = None) -> np.ndarray:
        """
        Return the pixels: (H, W, 3) uint8 B, G, R, or (H, W) uint8 of a recorded image.

        ``white_level`` is the value of 16-bit and float images that becomes 255; None is the white
        of their format.  An unreadable file raises SourceError, an unreadable recorded image
        FrameError.
        """
        if self.message is not None:
            return images.read(self.message, white_level or 0.0)
        return read_image(self.path, True, white_level) if self.pixels is None else self.pixels


def find(arguments: Iterable[str]) -> tuple[list[Path], list[str]]:
    """
    Return the files that arguments stand for, and a line for each argument without a file.

    An argument is a file, a rosbag2, a folder (its images and videos) or a glob pattern.  A file
    that several arguments stand for is in the list once, at its first place.
    """
    files: dict[Path, Path] = {}
    problems: list[str] = []
    for argument in arguments:
        for path in expand(argument, problems.append):
            files.setdefault(Path(os.path.realpath(path)), path)
    return list(files.values()), problems


def count(path: Path, topic: str) -> int:
    """Return the number of pictures in a file, by the header of a video or rosbag2."""
    kind = kind_of(path)
    if kind is Kind.IMAGE:
        return 1
    if kind is Kind.BAG:
        try:
            return Bag(path, topic, report_by_log).count
        except SourceError:
            return 0
    if not path.is_file():
        return 0
    return max(0, int(quiet_capture(str(path)).get(cv2.CAP_PROP_FRAME_COUNT)))


def names(files: list[Path]) -> list[str]:
    """
    Return a unique name for each file: its own, with as much of its path as is necessary.

    Files of a folder whose names differ only in the suffix keep the suffix.  Files of the same
    name in different folders are preceded by the names of the folders.  Names that differ only in
    capitals count as the same, since some file systems do not distinguish them.
    """
    folders = [Path(os.path.realpath(path.parent)) for path in files]
    stems = Counter((folder, _folded(path.stem)) for folder, path in zip(folders, files))
    twins = Counter((folder, _folded(path.name)) for folder, path in zip(folders, files))
    parts = [(*folder.parts[1:],
              path.stem if stems[folder, _folded(path.stem)] == 1 else path.name)
             for folder, path in zip(folders, files)]
    # The names of folders do not distinguish A.png from a.png in the same folder.
    short = [twins[folder, _folded(path.name)] > 1 for folder, path in zip(folders, files)]
    result = [part[-1] for part in parts]
    for depth in range(2, max(map(len, parts), default=1) + 1):
        count = Counter(map(_folded, result))
        result = [name if count[_folded(name)] == 1 or alone else '_'.join(part[-depth:])
                  for name, part, alone in zip(result, parts, short)]
    return _numbered(result)


def _numbered(wanted: list[str]) -> list[str]:
    """Append numbers to names that are still the same, as those of a_b/c and a/b_c."""
    all_wanted = set(map(_folded, wanted))
    taken: set[str] = set()
    result = []
    for name in wanted:
        free, number = name, 1
        while _folded(free) in taken or (number > 1 and _folded(free) in all_wanted):
            number += 1
            free = f'{name}_{number}'
        taken.add(_folded(free))
        result.append(free)
    return result


def _folded(name: str) -> str:
    """Return a form of a name that is equal for names that a file system may confuse."""
    return unicodedata.normalize('NFC', name).casefold()


def pictures(path: Path, name: str, topic: str, report: Report, tell: Report) -> Iterator[Picture]:
    """
    Yield the picture of an image file, or the frames of a video or rosbag2 in order.

    Frames are named ``name/000000`` and so on.  ``topic`` is the topic of a rosbag2, empty for the
    first one with images.  ``report`` is called with a line for each unreadable frame, ``tell``
    with other information.  A video or rosbag2 that cannot be opened raises SourceError.
    """
    kind = kind_of(path)
    if kind is Kind.IMAGE:
        yield Picture(path, name)
    elif kind is Kind.BAG:
        bag = Bag(path, topic, report, GRAY)
        if bag.note:
            tell(f'{bag.note}: choose by --topic')
        yield from _recorded(path, name, bag)
    else:
        for number, frame in enumerate(Video(path, True, report)):
            pixels = np.frombuffer(frame.data, np.uint8).reshape(frame.height, frame.width, 3)
            yield Picture(path, f'{name}/{number:06d}', number, pixels)


def _recorded(path: Path, name: str, bag: Bag) -> Iterator[Picture]:
    for number, frame in enumerate(bag):
        assert frame.recorded is not None and frame.stamp is not None
        moment = Moment(frame.recorded, frame.stamp, frame.frame_id or '')
        yield Picture(path, f'{name}/{number:06d}', number, message=frame, moment=moment)
