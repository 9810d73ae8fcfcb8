"""A folder of pictures, written by a thread beside other work."""
from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
import time

import cv2
import numpy as np

from qflsd_ros.cli.output.writing import private_room, write_whole


class Gallery:
    """
    Writes pictures as PNG in a thread of its own.

    A picture is skipped where its source is unknown or has a picture already, where it arrives
    within the interval after the last one, or while that is still being written.
    A context manager: leaving waits until all pictures are written.

    Attributes
    ----------
    paths
        The files that are written or being written, in order.

    """

    def __init__(self, folder: Path, interval: float) -> None:
        """Write into ``folder``, at most one picture in ``interval`` s."""
        self.paths: list[Path] = []
        self._folder, self._interval = folder, interval
        self._known: set[int] = set()
        self._last = -interval
        self._thread = ThreadPoolExecutor(1)
        self._stack = ExitStack()
        self._writing: Future[None] | None = None

    def __enter__(self) -> Gallery:
        """Make the folder of the pictures."""
        self._folder.mkdir(parents=True, exist_ok=True)
        self._room = self._stack.enter_context(private_room(self._folder))
        return self

    def __exit__(self, *_: object) -> None:
        """Wait for the last picture; raise OSError where it could not be written."""
        with self._stack:
            self._thread.shutdown()
            self._collect()

    def show(self, pixels: np.ndarray, source: int | None) -> None:
        """
        Write a picture, (H, W, 3) uint8 B, G, R, unless it is to be skipped.

        ``source`` identifies the image that the picture shows; None where that is unknown.
        Raises OSError where the picture before could not be written.
        """
        now = time.monotonic()
        if now - self._last < self._interval or self._writing and not self._writing.done():
            return
        self._collect()
        if source is None or source in self._known:
            return
        self._known.add(source)
        self._last = now
        self.paths.append(self._folder / f'{len(self.paths) + 1:04d}.png')
        self._writing = self._thread.submit(self._write, self.paths[-1].name, pixels)

    def _collect(self) -> None:
        if self._writing:
            self._writing.result()

    def _write(self, name: str, pixels: np.ndarray) -> None:
        write_whole(self._folder, name, cv2.imencode('.png', pixels)[1].tobytes(), self._room)
