"""The pictures that the command line names: files, globs, folders, videos and rosbag2s."""
from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
import os
from pathlib import Path
from typing import Iterable, Iterator, NamedTuple

import cv2
import numpy as np
from qflsd_ros.ros import images
from qflsd_ros.sources.bag import Bag, STORAGE_SUFFIXES
from qflsd_ros.sources.files import IMAGE_SUFFIXES, natural_order, read_image
from qflsd_ros.sources.frames import FrameError, Report, report_by_log, SourceError
from qflsd_ros.sources.video import quiet_capture, Video

# In a folder, these are taken for videos; a file named on its own is one unless it is an image.
VIDEO_SUFFIXES = ('.avi', '.m4v', '.mkv', '.mov', '.mp4', '.mpeg', '.mpg', '.webm')


class Moment(NamedTuple):
    """When a recorded image was taken and recorded, ns, and in which coordinate frame."""

    recorded: int
    stamp: int
    frame_id: str


@dataclass(frozen=True)
class Picture:
    """
    One picture to work on.

    Attributes
    ----------
    path
        The file that it comes from.
    name
        What its results are called, different for every picture.
    frame
        Its number in a video or rosbag2, from 0; None for an image file.
    pixels
        (H, W, 3) uint8 B, G, R of a frame; None for an image file, which whoever works on it
        reads.
    moment
        Of an image of a rosbag2; None for any other.

    """

    path: Path
    name: str
    frame: int | None = None
    pixels: np.ndarray | None = None
    moment: Moment | None = None

    def read(self) -> np.ndarray:
        """Return (H, W, 3) uint8 B, G, R; SourceError where the file cannot be read."""
        return read_image(self.path, colour=True) if self.pixels is None else self.pixels


def find(arguments: Iterable[str]) -> tuple[list[Path], list[str]]:
    """
    Return the files that arguments stand for, each once, in order, and which stand for none.

    An argument is a file, a rosbag2, a folder (its images and videos) or a glob pattern.
    """
    files: dict[Path, Path] = {}
    missing = []
    for argument in arguments:
        found = list(_expand(argument))
        if not found:
            missing.append(argument)
        for path in found:
            files.setdefault(Path(os.path.realpath(path)), path)
    return list(files.values()), missing


def _expand(argument: str) -> Iterator[Path]:
    path = Path(argument)
    for match in [path] if path.exists() else _matches(path):
        if match.is_dir() and not is_bag(match):
            yield from (file for file in sorted(match.iterdir(), key=natural_order)
                        if file.suffix.lower() in IMAGE_SUFFIXES + VIDEO_SUFFIXES)
        else:
            yield match


def _matches(pattern: Path) -> list[Path]:
    """Return what matches a glob pattern, but for what is hidden; links to folders end there."""
    folder = Path(pattern.anchor)
    try:
        found = sorted(folder.glob(str(pattern.relative_to(folder))))
    except ValueError:
        return []  # ** and something else between two slashes
    return [path for path in found
            if not any(part.startswith('.') and part not in pattern.parts for part in path.parts)]


def count(path: Path, topic: str) -> int:
    """Return the number of pictures in a file; of a video or rosbag2, what it says of itself."""
    if _is_image(path):
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
    """Tell a rosbag2, a folder or a file, from anything else."""
    return (path / 'metadata.yaml').exists() or path.suffix.lower() in STORAGE_SUFFIXES


def _is_image(path: Path) -> bool:
    return path.suffix.lower() in IMAGE_SUFFIXES


def names(files: list[Path]) -> list[str]:
    """
    Return a name for each file, no two alike: its own, with more of its path where it must be.

    Files of one folder that differ in their suffix alone keep it; files of the same name in
    different folders get the folder's name before theirs.
    """
    folders = [Path(os.path.realpath(path.parent)) for path in files]
    alike = Counter((folder, path.stem) for folder, path in zip(folders, files))
    parts = [(*folder.parts[1:], path.stem if alike[folder, path.stem] == 1 else path.name)
             for folder, path in zip(folders, files)]
    result = [part[-1] for part in parts]
    for depth in range(2, max(map(len, parts), default=1) + 1):
        count = Counter(result)
        result = [name if count[name] == 1 else '_'.join(part[-depth:])
                  for name, part in zip(result, parts)]
    return _numbered(result)


def _numbered(wanted: list[str]) -> list[str]:
    """Give numbers to what is still alike: a_b/c and a/b_c."""
    taken: set[str] = set()
    result = []
    for name in wanted:
        free, number = name, 1
        while free in taken or (number > 1 and free in wanted):
            number += 1
            free = f'{name}_{number}'
        taken.add(free)
        result.append(free)
    return result


def pictures(path: Path, name: str, topic: str, report: Report, tell: Report) -> Iterator[Picture]:
    """
    Return the picture of an image file, or the frames of a video or rosbag2 in order.

    Frames are called ``name/000000`` and so on; ``topic`` is that of a rosbag2, empty for the
    first with images.  ``report`` is called with what cannot be read, ``tell`` with what else
    there is to know.  Raises SourceError where a video or rosbag2 as a whole cannot be read.
    """
    if _is_image(path):
        yield Picture(path, name)
    elif is_bag(path):
        bag = Bag(path, topic, report)
        if bag.note:
            tell(f'{bag.note}: choose by --topic')
        yield from _recorded(path, name, bag, report)
    else:
        for number, frame in enumerate(Video(path, True, report)):
            pixels = np.frombuffer(frame.data, np.uint8).reshape(frame.height, frame.width, 3)
            yield Picture(path, f'{name}/{number:06d}', number, pixels)


def _recorded(path: Path, name: str, bag: Bag, report: Report) -> Iterator[Picture]:
    for number, frame in enumerate(bag):
        try:
            pixels = cv2.cvtColor(images.read(frame), cv2.COLOR_GRAY2BGR)
        except FrameError as error:
            report(f'{str(path)!r}: image {number}: {error}')
            continue
        assert frame.recorded is not None and frame.stamp is not None
        moment = Moment(frame.recorded, frame.stamp, frame.frame_id or '')
        yield Picture(path, f'{name}/{number:06d}', number, pixels, moment)
