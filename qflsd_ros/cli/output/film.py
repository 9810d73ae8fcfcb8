"""A video file of pictures that arrive at irregular intervals."""
from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
import time

import cv2
import numpy as np

from qflsd_ros.cli.output.writing import private_room, publish
from qflsd_ros.sources.video import quiet_capture

RATE = 30  # frames per second, the usual one of cameras


class Film:
    """
    Writes pictures as an MP4 file that shows each for as long as it took the next one to arrive.

    A context manager: the file is complete after leaving; without any picture there is no file.
    Leaving raises OSError where the file could not be written.
    """

    def __init__(self, path: Path) -> None:
        """Write to ``path``, whose name ends in .mp4."""
        self._path, self._stack = path, ExitStack()
        self._last: np.ndarray | None = None
        self._writer: cv2.VideoWriter | None = None

    def __enter__(self) -> Film:
        """Make the folder of the file."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        # In a private folder, since OpenCV would follow a link that another user has set.
        self._partial = self._stack.enter_context(private_room(self._path.parent)) / 'film.mp4'
        return self

    def __exit__(self, *_: object) -> None:
        """Finish the file."""
        with self._stack:
            if self._writer is not None:
                self._hold()
                self._writer.release()
                self._publish()

    def show(self, pixels: np.ndarray) -> None:
        """Add a picture, (H, W, 3) uint8 B, G, R; raise OSError where no file can be written."""
        if self._writer is None:
            self._start(pixels)
        else:
            self._hold()
        self._last = pixels

    def _start(self, pixels: np.ndarray) -> None:
        self._size = pixels.shape[1], pixels.shape[0]
        self._begin, self._frames = time.monotonic(), 0
        self._writer = cv2.VideoWriter(
            str(self._partial), cv2.VideoWriter.fourcc(*'mp4v'), RATE, self._size)
        if not self._writer.isOpened():
            self._writer = None
            raise OSError(f'{str(self._path)!r} cannot be written as a video')

    def _publish(self) -> None:
        """
        Move the file to its place; raise OSError where it is incomplete.

        OpenCV does not report errors in writing, so the frames in the file are counted.
        """
        if quiet_capture(str(self._partial)).get(cv2.CAP_PROP_FRAME_COUNT) < self._frames:
            raise OSError(f'{str(self._path)!r}: could not be written to its end: is the disk '
                          'full?')
        publish(self._partial, self._path.parent, self._path.name)

    def _hold(self) -> None:
        """Repeat the last picture up to the present time."""
        assert self._writer is not None and self._last is not None
        pixels = self._last
        if pixels.shape[1::-1] != self._size:
            pixels = cv2.resize(pixels, self._size, interpolation=cv2.INTER_AREA)
        while self._frames < (time.monotonic() - self._begin) * RATE:
            self._writer.write(pixels)
            self._frames += 1
