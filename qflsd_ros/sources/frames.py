"""What every source of images gives: frames, one after the other."""
from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
import logging
from typing import Any, Callable

import numpy as np
from qflsd_ros.sources.reasons import Reason

Report = Callable[[str], None]
MAX_TEXT = 1200  # characters: twice what naming all encodings takes
report_by_log: Report = logging.getLogger(__name__).warning


class SourceError(Exception):
    """A source that cannot be read; the text says in a line what, where, and what would do."""


class FrameError(ValueError):
    """
    A frame that cannot be worked on; ``reason`` is the phrase of its reason.

    The text is in one line, and shortened in the middle where somebody who sent the frame has put
    more into it than a line of a log should hold.
    """

    def __init__(self, reason: Reason, text: str) -> None:
        super().__init__(shortened(text))
        self.reason = reason.phrase


def shortened(text: str) -> str:
    """Return a text of at most MAX_TEXT characters: the middle of a longer one is left out."""
    if len(text) <= MAX_TEXT:
        return text
    left_out = f' [{len(text) - MAX_TEXT} characters] '
    kept = (MAX_TEXT - len(left_out)) // 2
    return text[:kept] + left_out + text[-kept:]


@dataclass(frozen=True)
class Frame:
    """
    One image with the fields of sensor_msgs/Image.

    Attributes
    ----------
    name
        What a person calls it: a file's name, or its number.
    height, width, encoding, is_bigendian, step
        As in sensor_msgs/Image.
    data
        (step * height,) bytes; of a recorded message whatever was recorded.
    stamp
        ns, when the frame was taken; None for those that never were.
    frame_id
        The camera's coordinate frame; None where the source does not say.
    recorded
        ns, when a recording got the frame; None outside recordings.

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

    @classmethod
    def of(cls, image: np.ndarray, encoding: str, name: str, **more: Any) -> Frame:
        """Make a frame of an (H, W) or (H, W, C) image, of uint8 or uint16 in native order."""
        height, width = image.shape[:2]
        step = image.nbytes // height
        big = image.itemsize > 1 and not np.little_endian
        return cls(name, height, width, encoding, big, step, image.tobytes(), **more)


class Source(ABC):
    """
    Frames to iterate over, as often as wanted: each time from the first one on.

    Iterating raises :class:`SourceError` where no frame at all can be read.

    Attributes
    ----------
    skipped
        Number of frames that could not be read so far, each reported once.
    note
        What a person may want to know of how it is read; empty for nothing.
    live
        Whether frames come at the pace of a camera, with the time at which they were taken.
    on_demand
        Whether frames may come late: nobody misses one, and each costs something.

    """

    live = False
    on_demand = False

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
        if empty:
            raise SourceError(f'{self.name}: not one frame in it can be read')

    def warm_up(self) -> None:
        """Do what takes long before the first frame, but for reading: by default, nothing."""

    @abstractmethod
    def _frames(self) -> Iterator[Frame]:
        """Yield the frames, and skip what cannot be read."""

    def _skip(self, what: str) -> None:
        """Count and report what cannot be read; the same again is neither."""
        if what not in self._reported:
            self._reported.add(what)
            self._report(what)
