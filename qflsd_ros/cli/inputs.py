"""The pictures that the command line names: files, globs, folders, videos and rosbag2s."""
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
from qflsd_ros.sources.bag import Bag, STORAGE_SUFFIXES
from qflsd_ros.sources.encoded import GRAY
from qflsd_ros.sources.files import IMAGE_SUFFIXES, natural_order, read_image
from qflsd_ros.sources.frames import Frame, Report, report_by_log, SourceError
from qflsd_ros.sources.video import quiet_capture, Video

# In a folder, only these are read as videos; any file that is named itself is, unless an image.
VIDEO_SUFFIXES = ('.avi', '.m4v', '.mkv', '.mov', '.mp4', '.mpeg', '.mpg', '.webm')


class Moment(NamedTuple):
    """Times (ns) at which an image in a bag was recorded and taken, and its coordinate frame."""

    recorded: int
    stamp: int
    frame_id: str


@dataclass(frozen=True)
class Picture:
    """
    One picture to process.

    Attributes
    ----------
    path
        The file that holds the picture.
    name
        Name of its result files without suffix, unique among all pictures.
    frame
        Number of the frame in a video or rosbag2, from 0; None for an image file.
    pixels
        Video frame, (H, W, 3) uint8 B, G, R; None where :meth:`read` reads or converts it.
    message
        Image message of a rosbag2; None for any other picture.
    moment
        Times and coordinate frame of an image of a rosbag2; None for any other picture.

    """

    path: Path
    name: str
    frame: int | None = None
    pixels: np.ndarray | None = None
    message: Frame | None = None
    moment: Moment | None = None

    def read(self, white_level: float | None = None) -> np.ndarray:
        """
        Return the pixels: (H, W, 3) uint8 B, G, R, or (H, W) uint8 for an image of a rosbag2.

        ``white_level`` is the value that becomes 255 in images of 16 bits or floats, None for the
        largest value of their format. Raises SourceError where a file cannot be read, FrameError
        where an image of a rosbag2 cannot.
        """
        if self.message is not None:
            return images.read(self.message, white_level or 0.0)
        return read_image(self.path, True, white_level) if self.pixels is None else self.pixels


def find(arguments: Iterable[str]) -> tuple[list[Path], list[str]]:
    """
    Return the files that arguments name, each once and in order, and a text for each problem.

    An argument is a file, a rosbag2, a folder (for its images and videos) or a glob pattern.
    """
    files: dict[Path, Path] = {}
    problems: list[str] = []
    for argument in arguments:
        for path in _expand(argument, problems.append):
            files.setdefault(Path(os.path.realpath(path)), path)
    return list(files.values()), problems


def _expand(argument: str, complain: Report) -> Iterator[Path]:
    path = Path(argument)
    if os.path.isdir(path) and not is_bag(path):
        yield from _contents(path, complain)
        return
    matches = [path] if os.path.exists(path) else _matches(path)
    if not matches:
        complain(f'{argument!r}: no such file, and no file matches it')
    for match in matches:
        if match.is_dir() and not is_bag(match):
            yield from _contents(match, lambda _: None)     # a pattern matches anything
        else:
            yield match


def _contents(folder: Path, complain: Report) -> list[Path]:
    """Return the images and videos of a folder in natural order."""
    suffixes = IMAGE_SUFFIXES + VIDEO_SUFFIXES
    try:
        found = [file for file in folder.iterdir() if file.suffix.lower() in suffixes]
    except OSError as error:
        complain(f'{str(folder)!r}: {error.strerror}')
        return []
    if not found:
        complain(f'{str(folder)!r}: no image or video in this folder: their names must end in '
                 f'{", ".join(suffixes)}')
    return sorted(found, key=natural_order)


def _matches(pattern: Path) -> list[Path]:
    """Return the paths that match a glob pattern, without hidden ones; follow no folder links."""
    folder = Path(pattern.anchor)
    try:
        found = sorted(folder.glob(str(pattern.relative_to(folder))))
    except (OSError, ValueError):
        return []  # a name is too long, or ** is only a part of a name
    return [path for path in found
            if not any(part.startswith('.') and part not in pattern.parts for part in path.parts)]


def count(path: Path, topic: str) -> int:
    """Return the number of pictures in a file, by the header of a video or rosbag2."""
    if is_image(path):
        return 1
    if is_bag(path):
        try:
            return Bag(path, topic, report_by_log).count
        except SourceError:
            return 0
    if not path.is_file():
        return 0
    return max(0, int(quiet_capture(str(path)).get(cv2.CAP_PROP_FRAME_COUNT)))


def is_bag(path: Path) -> bool:
    """Return whether a path is a rosbag2: a folder with metadata, or a storage file."""
    return os.path.exists(path / 'metadata.yaml') or path.suffix.lower() in STORAGE_SUFFIXES


def is_image(path: Path) -> bool:
    """Return whether a path is an image file, by its suffix."""
    return path.suffix.lower() in IMAGE_SUFFIXES


def names(files: list[Path]) -> list[str]:
    """
    Return a unique name for each file: its stem, with more of its path where needed.

    Files in one folder that differ only in their suffix keep the suffix; files of the same name
    in different folders are prefixed with the name of their folder. Names that differ only in
    case count as equal, because file systems may ignore case.
    """
    folders = [Path(os.path.realpath(path.parent)) for path in files]
    stems = Counter((folder, _folded(path.stem)) for folder, path in zip(folders, files))
    twins = Counter((folder, _folded(path.name)) for folder, path in zip(folders, files))
    parts = [(*folder.parts[1:],
              path.stem if stems[folder, _folded(path.stem)] == 1 else path.name)
             for folder, path in zip(folders, files)]
    # The folder does not distinguish A.png from a.png beside it.
    short = [twins[folder, _folded(path.name)] > 1 for folder, path in zip(folders, files)]
    result = [part[-1] for part in parts]
    for depth in range(2, max(map(len, parts), default=1) + 1):
        count = Counter(map(_folded, result))
        result = [name if count[_folded(name)] == 1 or alone else '_'.join(part[-depth:])
                  for name, part, alone in zip(result, parts, short)]
    return _numbered(result)


def _numbered(wanted: list[str]) -> list[str]:
    """Append numbers to names that are still equal, as those of a_b/c and a/b_c."""
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
    """Return a key that is equal for names that a file system may regard as the same."""
    return unicodedata.normalize('NFC', name).casefold()


def pictures(path: Path, name: str, topic: str, report: Report, tell: Report) -> Iterator[Picture]:
    """
    Yield the picture of an image file, or the frames of a video or rosbag2 in order.

    Frames are named ``name/000000`` and so on. ``topic`` is the image topic of a rosbag2; if
    empty, the first one with images. ``report`` is called with errors about single frames,
    ``tell`` with notes. Raises SourceError where a video or rosbag2 as a whole cannot be read.
    """
    if is_image(path):
        yield Picture(path, name)
    elif is_bag(path):
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
