"""Find the right source for what a person names."""
from __future__ import annotations

from pathlib import Path

from qflsd_ros.sources.bag import Bag, STORAGE_SUFFIXES
from qflsd_ros.sources.files import IMAGE_SUFFIXES, open_folder, open_image
from qflsd_ros.sources.frames import Report, report_by_log, Source, SourceError
from qflsd_ros.sources.video import Video, Webcam


def open_source(text: str, colour: bool = False, topic: str = '', rate: float = 30.0,
                report: Report = report_by_log) -> Source:
    """
    Open an image, a folder of images, a video, a webcam or a rosbag2.

    Parameters
    ----------
    text
        A path; or the index of a webcam, as 0.
    colour
        Whether images come as bgr8 instead of mono8; raw images of a rosbag2 come as recorded.
    topic
        Of a rosbag2, which topic to read; where empty, the first that has images.
    rate
        Frames per second to ask of a webcam.
    report
        Called with a line of text on everything that cannot be read and is left out.

    Raises
    ------
    SourceError
        It is not there or cannot be read.

    """
    if text.isdecimal():
        return Webcam(int(text), colour, rate, report)
    path = Path(text).expanduser()
    try:
        if path.is_dir():
            is_bag = (path / 'metadata.yaml').exists()
            return Bag(path, topic, report) if is_bag else open_folder(path, colour, report)
        if path.is_file():
            return _open_file(path, colour, topic, report)
    except OSError as error:
        raise SourceError(f'{text!r}: {error.strerror}') from error
    raise SourceError(f'{text!r} is not there: must be an image, a folder of images, a video, a '
                      'rosbag2 or the index of a webcam')


def _open_file(path: Path, colour: bool, topic: str, report: Report) -> Source:
    suffix = path.suffix.lower()
    if suffix in STORAGE_SUFFIXES:
        return Bag(path, topic, report)
    if suffix in IMAGE_SUFFIXES:
        return open_image(path, colour, report)
    return Video(path, colour, report)
