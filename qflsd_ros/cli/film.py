"""Pictures as they come, as a video."""
from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
import time

import cv2
import numpy as np

from qflsd_ros.cli.writing import private_room, publish
from qflsd_ros.sources.video import quiet_capture

RATE = 30  # frames per second


class Film:
    """
    Writes pictures as an MP4 that plays at the pace at which they came.

    A context manager: the file is there, whole, after leaving, unless no picture came; leaving
    raises OSError where it could not be written.
    """

    def __init__(self, path: Path) -> None:
        """Write to ``path``, whose name ends in .mp4."""
        self._path, self._stack = path, ExitStack()
        self._writer: cv2.VideoWriter | None = None

    def __enter__(self) -> Film:
        """Make the folder."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        # OpenCV follows links.
        self._partial = self._stack.enter_context(private_room(self._path.parent)) / 'film.mp4'
        return self

    def __exit__(self, *_: object) -> None:
        """Finish the file."""
        with self._stack:
            if self._writer is not None:
                self._hold(self._last)
                self._writer.release()
                self._publish()

    def show(self, pixels: np.ndarray) -> None:
        """Take a picture, (H, W, 3) uint8 B, G, R; OSError where the file cannot be written."""
        if self._writer is None:
            self._start(pixels)
        else:
            self._hold(self._last)
        self._last = pixels

    def _start(self, pixels: np.ndarray) -> None:
        self._size = pixels.shape[1], pixels.shape[0]
        self._begin, self._frames = time.monotonic(), 0
        self._writer = cv2.VideoWriter(
            str(self._partial), cv2.VideoWriter_fourcc(*'mp4v'), RATE, self._size)
        if not self._writer.isOpened():
            self._writer = None
            raise OSError(f'{str(self._path)!r} cannot be written as a video')

    def _publish(self) -> None:
        """Give the file its name; OpenCV does not tell whether all of it could be written."""
        if quiet_capture(str(self._partial)).get(cv2.CAP_PROP_FRAME_COUNT) < self._frames:
            raise OSError(f'{str(self._path)!r}: could not be written to its end: is the disk '
                          'full?')
        publish(self._partial, self._path.parent, self._path.name)

    def _hold(self, pixels: np.ndarray) -> None:
        """Show a picture until now."""
        assert self._writer is not None
        if pixels.shape[1::-1] != self._size:
            pixels = cv2.resize(pixels, self._size, interpolation=cv2.INTER_AREA)
        while self._frames < (time.monotonic() - self._begin) * RATE:
            self._writer.write(pixels)
            self._frames += 1
