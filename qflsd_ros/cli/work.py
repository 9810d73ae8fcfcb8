"""The work of ``detect`` on one picture: detect its arcs and write their files."""
from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
import time
from typing import Any, NamedTuple

import cv2
import numpy as np
from qflsd_ros import records
from qflsd_ros.cli import results
from qflsd_ros.cli.inputs import Picture
from qflsd_ros.cli.recordings import Cloud
from qflsd_ros.cli.settings import Options
from qflsd_ros.core import Arcs, Detector, with_straightness
from qflsd_ros.core.lens import estimation
from qflsd_ros.ros.finding import find
from qflsd_ros.ros.lens import CameraLens
from qflsd_ros.sources.frames import FrameError, SourceError


class Found(NamedTuple):
    """
    The arcs of a picture.

    Attributes
    ----------
    pixels
        (H, W, 3) B, G, R or (H, W) grey, uint8.
    arcs
        The arcs, with their column ``straight``.
    lens
        The lens as in the JSON file; None where it is unknown.
    seconds
        CPU time of the detection.

    """

    pixels: np.ndarray
    arcs: Arcs
    lens: dict[str, Any] | None
    seconds: float


@dataclass(frozen=True)
class Outcome:
    """
    The outcome for one picture: number of arcs and CPU time (s) of detection, or an error.

    ``cloud`` holds the segments of an image from a bag; None for any other.
    """

    arcs: int = 0
    seconds: float = 0.0
    error: str = ''
    cloud: Cloud | None = None


class Task(NamedTuple):
    """A picture, with its arcs or its error where detection has been done already."""

    picture: Picture
    found: Found | Outcome | None = None


class Work:
    """Detects arcs in pictures and writes their results."""

    def __init__(self, options: Options, folder: Path, room: Path) -> None:
        """
        Load the kernels of the detector, or compile them.

        ``folder`` is the folder of the results, ``room`` a private folder in it.
        """
        self._options, self._folder, self._room = options, folder, room
        self._detector = Detector(options.detector)
        self._detector.warm_up()
        estimation.warm_up()

    def found(self, picture: Picture, camera: CameraLens) -> Found | Outcome:
        """Return the arcs of the next picture of a camera, or the error."""
        try:
            return self._find(picture, camera)
        except SourceError as error:
            return Outcome(error=str(error))
        except FrameError as error:     # its text does not name the file
            number = '' if picture.frame is None else f' image {picture.frame}:'
            return Outcome(error=f'{str(picture.path)!r}:{number} {error}')

    def _find(self, picture: Picture, camera: CameraLens) -> Found:
        settings = self._options.node
        pixels = picture.read(settings.white_level or None)
        gray = pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
        begin = time.process_time()
        arcs, model = find(gray, self._detector, settings, camera)
        seconds = time.process_time() - begin
        lens = results.lens(model, camera.estimate(settings))
        return Found(pixels, with_straightness(arcs, model), lens, seconds)

    def __call__(self, task: Task) -> Outcome:
        """Write the results of a picture; detect its arcs first where that is not done yet."""
        picture, found = task
        try:
            found = found or self.found(picture, CameraLens())
            if isinstance(found, Outcome):
                return found
            results.write(self._folder, self._room, picture, found.pixels, found.arcs, found.lens,
                          self._options)
        except OSError as error:
            return Outcome(error=f'results of {picture.name!r} cannot be written: {error}')
        return Outcome(len(found.arcs), found.seconds, cloud=self._cloud(picture, found.arcs))

    def _cloud(self, picture: Picture, arcs: Arcs) -> Cloud | None:
        if picture.moment is None:
            return None
        bag = picture.name.rpartition('/')[0]
        tolerance = self._options.node.polyline_tolerance
        return Cloud(bag, picture.moment, records.of_segments(arcs, tolerance))
