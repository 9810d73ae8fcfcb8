"""Videos and webcams as sources."""
from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import time

import cv2
import numpy as np

from qflsd_ros.sources.files import check_file, encoding
from qflsd_ros.sources.frames import Frame, Report, Source, SourceError

WEBCAMS = 100  # OpenCV selects the capture interface by the hundreds of an index


class Video(Source):
    """A video file, as mono8 or bgr8."""

    def __init__(self, path: Path, colour: bool, report: Report) -> None:
        super().__init__(repr(str(path)), report)
        self._path, self._colour = path, colour
        self._open().release()

    def _open(self) -> cv2.VideoCapture:
        check_file(self._path)
        capture = quiet_capture(str(self._path))
        if not capture.isOpened():
            raise SourceError(f'{self.name}: no video that can be read: it is damaged or in a '
                              'format that OpenCV does not know')
        return capture

    def _frames(self) -> Iterator[Frame]:
        capture, count = self._open(), 0
        promised = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        while (image := capture.read()[1]) is not None:
            yield Frame.of(convert(image, self._colour), encoding(self._colour), f'frame {count}')
            count += 1
        if count < promised:
            self._skip(f'{self.name}: ends after {count} frames of {promised}: it is damaged or '
                       'was cut short')


class Webcam(Source):
    """A webcam, as mono8 or bgr8; the stamp of a frame is the time of its arrival."""

    live = True

    def __init__(self, index: int, colour: bool, rate: float, report: Report) -> None:
        super().__init__(f'webcam {index}', report)
        if index >= WEBCAMS:
            raise SourceError(f'{self.name}: its number must lie in 0 to {WEBCAMS - 1}')
        self._colour = colour
        self._capture = quiet_capture(index)
        if not self._capture.isOpened():
            raise SourceError(f'{self.name}: cannot be opened: it is not there, another program '
                              f'uses it, or the permission to read /dev/video{index} is missing')
        self._capture.set(cv2.CAP_PROP_FPS, rate)

    def _frames(self) -> Iterator[Frame]:
        count = 0
        while (image := self._capture.read()[1]) is not None:
            yield Frame.of(convert(image, self._colour), encoding(self._colour), f'frame {count}',
                           stamp=time.time_ns())
            count += 1
        raise SourceError(f'{self.name}: gave no more frames after {count}: was it unplugged?')


def quiet_capture(source: str | int) -> cv2.VideoCapture:
    """Open a video or webcam; silence the messages of OpenCV and FFmpeg on stderr."""
    os.environ.setdefault('OPENCV_FFMPEG_LOGLEVEL', '-8')
    # The function has another place in OpenCV 5; level 0 is silent.
    (cv2.setLogLevel if hasattr(cv2, 'setLogLevel') else cv2.utils.logging.setLogLevel)(0)
    return cv2.VideoCapture(source)


def convert(image: np.ndarray, colour: bool) -> np.ndarray:
    """Return an (H, W, 3) B, G, R image as it is, or else converted to grey, (H, W)."""
    return image if colour else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
