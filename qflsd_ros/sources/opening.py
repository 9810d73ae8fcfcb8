"""
The one dispatcher of sources: it decides what a path, a pattern or a number stands for.

The node ``camera`` opens one source by :func:`open_source`.  The command ``detect`` expands its
arguments by :func:`expand` and reads each file by its :func:`kind_of`.
"""
from __future__ import annotations

from enum import Enum
import os
from pathlib import Path

from qflsd_ros.sources.files import IMAGE_SUFFIXES, list_files, open_folder, open_image
from qflsd_ros.sources.frames import Report, report_by_log, Source, SourceError
from qflsd_ros.sources.sequence import DESCRIPTION, Sequence
from qflsd_ros.sources.video import Video, Webcam

BAG_SUFFIXES = ('.mcap', '.db3')    # of both kinds of storage of rosbag2
# Suffixes of the files in a folder that count as videos.  A file that is named explicitly is
# opened as a video whatever its suffix, unless that belongs to another kind: OpenCV reads more
# formats than these.
VIDEO_SUFFIXES = ('.avi', '.m4v', '.mkv', '.mov', '.mp4', '.mpeg', '.mpg', '.webm')


class Kind(Enum):
    """The kind of input that a path is read as."""

    IMAGE = 'image'
    VIDEO = 'video'
    BAG = 'rosbag2'
    FOLDER = 'folder of images'


def kind_of(path: Path) -> Kind:
    """
    Return the kind of a path, without opening it.

    A folder is a rosbag2 if it has a metadata.yaml.  A file is of the kind of its suffix, and a
    video if the suffix is of no other kind.
    """
    if os.path.isdir(path):
        return Kind.BAG if os.path.exists(path / 'metadata.yaml') else Kind.FOLDER
    suffix = path.suffix.lower()
    if suffix in BAG_SUFFIXES:
        return Kind.BAG
    return Kind.IMAGE if suffix in IMAGE_SUFFIXES else Kind.VIDEO


def open_source(text: str, colour: bool = False, topic: str = '', rate: float = 30.0,
                report: Report = report_by_log) -> Source:
    """
    Open an image, a folder of images, a sequence, a video, a webcam or a rosbag2.

    Parameters
    ----------
    text
        A path, or the number of a webcam, as ``0``.  A folder of images that has a sequence.json
        is a sequence.
    colour
        Whether images are converted to bgr8 instead of mono8.  Raw images of a rosbag2 keep their
        encoding.
    topic
        The topic of a rosbag2 to read; empty for the first one that has images.
    rate
        Frames per second to request from a webcam.
    report
        Called with a line of text for each frame that is skipped because it cannot be read.

    Returns
    -------
    source
        The source; its frames are read when it is iterated.

    Raises
    ------
    SourceError
        The source does not exist or cannot be read.

    """
    if text.isdecimal():
        return Webcam(int(text), colour, rate, report)
    path = Path(text).expanduser()
    try:
        if not path.is_dir() and not path.is_file():
            raise SourceError(f'{text!r} is not there: must be an image, a folder of images, a '
                              'video, a rosbag2 or the index of a webcam')
    except OSError as error:
        raise SourceError(f'{text!r}: {error.strerror}') from error
    kind = kind_of(path)
    if kind is Kind.BAG:
        from qflsd_ros.sources.bag import Bag   # rosbags takes 8 MB
        return Bag(path, topic, report)
    if kind is Kind.FOLDER and os.path.exists(path / DESCRIPTION):
        return Sequence(path, colour, report)
    if kind is Kind.FOLDER:
        return open_folder(path, colour, report)
    if kind is Kind.IMAGE:
        return open_image(path, colour, report)
    return Video(path, colour, report)


def expand(text: str, report: Report) -> list[Path]:
    """
    Return the images, videos and rosbag2s that a path or a glob pattern stands for.

    A folder stands for the images and videos in it.  An existing path is not treated as a
    pattern.

    Parameters
    ----------
    text
        The path, or a pattern with ``*``, ``?``, ``[...]``, or ``**`` for any folders.
    report
        Called with a line of text if there is no such file, no match, or nothing in the folder.

    Returns
    -------
    paths
        Those of a folder in natural order, those of a pattern in alphabetical order.

    """
    path = Path(text)
    if os.path.exists(path):
        return _contents(path, report) if kind_of(path) is Kind.FOLDER else [path]
    matches = _matches(path)
    if not matches:
        report(f'{text!r}: no such file, and no file matches it')
    paths: list[Path] = []
    for match in matches:
        # A pattern may match folders without images, which is no mistake.
        paths += _contents(match, _ignore) if kind_of(match) is Kind.FOLDER else [match]
    return paths


def _contents(folder: Path, report: Report) -> list[Path]:
    """Return the images and videos of a folder in natural order."""
    suffixes = IMAGE_SUFFIXES + VIDEO_SUFFIXES
    try:
        paths = list_files(folder, suffixes)
    except SourceError as error:
        report(str(error))
        return []
    if not paths:
        report(f'{str(folder)!r}: no image or video in this folder: their names must end in '
               f'{", ".join(suffixes)}')
    return paths


def _ignore(_: str) -> None:
    """Drop a report."""


def _matches(pattern: Path) -> list[Path]:
    """Return the matches of a glob pattern, without hidden files; links to folders end there."""
    folder = Path(pattern.anchor)
    try:
        found = sorted(folder.glob(str(pattern.relative_to(folder))))
    except (OSError, ValueError):
        return []  # a name is too long, or ** does not stand alone between slashes
    return [path for path in found
            if not any(part.startswith('.') and part not in pattern.parts for part in path.parts)]
