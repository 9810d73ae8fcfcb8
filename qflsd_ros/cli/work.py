"""The work of ``detect`` on one picture: detect its arcs and write their files."""
from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
import time
from typing import Any, NamedTuple

import cv2
import numpy as np
from qflsd_ros import overlay, records
from qflsd_ros.attitude_drawing import draw_attitude
from qflsd_ros.cli.inputs import Picture
from qflsd_ros.cli.output import results
from qflsd_ros.cli.output.recordings import Cloud
from qflsd_ros.cli.settings import Options
from qflsd_ros.core import Arcs, Attitude, Detector, Tracker
from qflsd_ros.core.attitude import tracker as attitude_tracker
from qflsd_ros.core.attitude.estimation import directions
from qflsd_ros.core.attitude.view import Lens
from qflsd_ros.core.lens import estimation
from qflsd_ros.core.lens.straightness import straightness
from qflsd_ros.overlay import NO_TAILS, Tails
from qflsd_ros.ros.attitude import CameraAttitude, of_image
from qflsd_ros.ros.finding import find, FrameSequence, Seen
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
        The arcs, with their column ``straight``, and ``direction`` if the attitude is wanted.
    tails
        The last positions of the tracks of a frame.
    attitude
        The attitude, None where it is unknown or not wanted.
    camera
        Lens and attitude as in the JSON file.
    seconds
        CPU time of the detection.

    """

    pixels: np.ndarray
    arcs: Arcs
    tails: Tails
    attitude: Attitude | None
    camera: dict[str, Any]
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


class Sequence(NamedTuple):
    """The states that follow the frames of a video or bag: lines and lens, and attitude."""

    frames: FrameSequence
    attitude: CameraAttitude


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
        if options.node.attitude:
            attitude_tracker.warm_up()

    def sequence(self) -> Sequence:
        """Return the states for a video or bag, with their kernels loaded or compiled."""
        Tracker().warm_up()
        return Sequence(FrameSequence(), CameraAttitude())

    def found(self, picture: Picture, sequence: Sequence | None = None) -> Found | Outcome:
        """Return the arcs of the next frame of a sequence, or of an image file, or the error."""
        try:
            return self._find(picture, sequence)
        except SourceError as error:
            return Outcome(error=str(error))
        except FrameError as error:     # its text does not name the file
            number = '' if picture.frame is None else f' image {picture.frame}:'
            return Outcome(error=f'{str(picture.path)!r}:{number} {error}')

    def _find(self, picture: Picture, sequence: Sequence | None) -> Found:
        settings = self._options.node
        pixels = picture.read(settings.white_level or None)
        gray = pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
        begin = time.process_time()
        camera = sequence.frames.lens if sequence else CameraLens()
        if sequence:
            seen = sequence.frames.find(gray, self._options.detector, settings)
        else:
            seen = Seen(*find(gray, self._detector.detect, settings, camera), NO_TAILS)
        seconds = time.process_time() - begin
        estimate = camera.estimate(settings)
        columns = {'straight': straightness(seen.arcs, seen.model)}
        terms: dict[str, Any] = {'lens': results.lens(seen.model, estimate), 'attitude': None}
        attitude = None
        if settings.attitude:
            attitude, reason = self._attitude(seen.arcs, gray.shape, estimate or seen.model,
                                              sequence)
            terms['attitude'] = results.attitude(attitude, reason)
            columns['direction'] = directions(seen.arcs, attitude)
        return Found(pixels, seen.arcs.with_columns(**columns), seen.tails, attitude, terms,
                     seconds)

    def _attitude(self, arcs: Arcs, shape: tuple[int, int], lens: Lens,
                  sequence: Sequence | None) -> tuple[Attitude | None, str]:
        """Return the attitude of the next frame of a sequence, or of an image file, or why not."""
        settings = self._options.node
        if sequence is None:
            return of_image(arcs, shape, settings, lens)
        follower = sequence.attitude
        return follower.follow(arcs, shape, settings, lens, None), follower.reason

    def __call__(self, task: Task) -> Outcome:
        """Write the results of a picture; detect its arcs first where that is not done yet."""
        picture, found = task
        try:
            found = found or self.found(picture)
            if isinstance(found, Outcome):
                return found
            drawn = overlay.draw(found.pixels, found.arcs, self._options.node.line_width,
                                 found.tails)
            if found.attitude is not None and self._options.node.draw_attitude:
                draw_attitude(drawn, found.attitude, self._options.node.line_width)
            results.write(self._folder, self._room, picture, drawn, found.arcs, found.camera,
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
