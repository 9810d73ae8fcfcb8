"""Frames, and the interface of the sources that yield them."""
from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
import logging
from typing import Any, Callable

import numpy as np
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.sources.reasons import Reason

Report = Callable[[str], None]
MAX_TEXT = 1200  # characters: twice the length of an error that lists all encodings
report_by_log: Report = logging.getLogger(__name__).warning


class SourceError(Exception):
    """A source cannot be read; the text is a line that names source, fault and remedy."""


class FrameError(ValueError):
    """
    A frame cannot be processed; ``reason`` is the phrase of the :class:`Reason`.

    The text is one line.  It is shortened in the middle if it quotes so much of the frame that it
    would flood the log.
    """

    def __init__(self, reason: Reason, text: str) -> None:
        super().__init__(shortened(text))
        self.reason = reason.phrase


def shortened(text: str) -> str:
    """Return a text of at most MAX_TEXT characters; the middle of a longer text is omitted."""
    if len(text) <= MAX_TEXT:
        return text
    left_out = f' [{len(text) - MAX_TEXT} characters] '
    kept = (MAX_TEXT - len(left_out)) // 2
    return text[:kept] + left_out + text[-kept:]


@dataclass(frozen=True)
class Frame:
    """
    An image with the fields of sensor_msgs/Image.

    Attributes
    ----------
    name
        Name for reports: the name of a file, or the number of a frame.
    height, width, encoding, is_bigendian, step
        As in sensor_msgs/Image.
    data
        step * height bytes; the data of a recorded message is as recorded, of any length.
    stamp
        Time at which the frame was taken, ns; None for files.
    frame_id
        Coordinate frame of the camera; None if the source does not have one.
    recorded
        Time at which the frame was recorded, ns; None outside recordings.
    pose
        (4, 4) float64, maps points of the optical frame to the map, m; None if it is not known.

    """

    name: str
    height: int
    width: int
    encoding: str
    is_bigendian: bool
    step: int
    data: bytes
    stamp: int | None = None
    frame_id: str | None = None
    recorded: int | None = None
    pose: np.ndarray | None = field(default=None, compare=False)

    @classmethod
    def of(cls, image: np.ndarray, encoding: str, name: str, **more: Any) -> Frame:
        """Return a frame of an (H, W) or (H, W, C) image, uint8 or uint16 in native order."""
        height, width = image.shape[:2]
        step = image.nbytes // height
        big = image.itemsize > 1 and not np.little_endian
        return cls(name, height, width, encoding, big, step, image.tobytes(), **more)


class Source(ABC):
    """
    An iterable of frames; each iteration begins with the first frame.

    An iteration in which no frame can be read raises :class:`SourceError`.

    Attributes
    ----------
    skipped
        Number of different faults for which frames were skipped; each is reported once.
    note
        Information for the user about how the source is read, or an empty text.
    live
        Whether frames arrive at the rate of a camera and have the time at which they were taken.
    on_demand
        Whether each frame is computed when it is requested, so that frames may be omitted.
    camera
        The calibrated camera that took the frames; None if it is not known.
    posed
        Whether the frames have poses.
    frame_size
        Bytes of each frame; None if that is not known before the first one.

    """

    live = False
    on_demand = False
    camera: CameraModel | None = None
    posed = False
    frame_size: int | None = None

    def __init__(self, name: str, report: Report) -> None:
        self.name = name
        self.note = ''
        self._report = report
        self._reported: set[str] = set()

    @property
    def skipped(self) -> int:
        return len(self._reported)

    def __iter__(self) -> Iterator[Frame]:
        """Yield all frames that can be read."""
        empty = True
        for frame in self._frames():
            empty = False
            yield frame
            del frame
        if empty:
            raise SourceError(f'{self.name}: not one frame in it can be read')

    def warm_up(self) -> None:
        """Prepare the first frame, if that takes long; by default, do nothing."""

    @abstractmethod
    def _frames(self) -> Iterator[Frame]:
        """Yield the readable frames, and report the others by :meth:`_skip`."""

    def _skip(self, fault: str) -> None:
        """Count and report the fault of a frame, unless the same text was reported before."""
        if fault not in self._reported:
            self._reported.add(fault)
            self._report(fault)
