"""Arcs in single images and in the successive frames of one camera; imports no ROS."""
from __future__ import annotations

from typing import Callable, NamedTuple

import numpy as np
from qflsd_ros.core import Arcs, Detector, Parameters, Tracker
from qflsd_ros.core.detection.image_circle import ImageCircle
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.overlay import Tails, Trails
from qflsd_ros.ros.input.region import reduced, view
from qflsd_ros.ros.lens import CameraLens
from qflsd_ros.ros.parameters.node_parameters import Settings, tracks_lines

# Finds arcs in an image (H, W) uint8 with a mask and a lens, as Detector.detect, Tracker.track.
Search = Callable[['np.ndarray', 'np.ndarray | None', 'DivisionModel | None'], Arcs]


def find(gray: np.ndarray, search: Search, settings: Settings,
         lens: CameraLens) -> tuple[Arcs, DivisionModel | None]:
    """
    Find the arcs of the next frame, using the lens as known from the frames before.

    Parameters
    ----------
    gray
        (H, W) uint8.
    search
        Method of a detector or tracker that no other thread uses.
    settings
        Region, mask and largest width of the image, and the origin of the lens.
    lens
        State of the camera's lens; it is updated with the arcs of this frame.

    Returns
    -------
    arcs
        The arcs, in px of ``gray``.
    model
        The lens after this frame, None while it is unknown.

    Raises
    ------
    ViewError
        The region lies outside the image, or the mask has another size.
    SourceError
        The mask file cannot be read.

    """
    factor, mask = view(settings, *gray.shape)
    before = lens.known(gray.shape, settings)
    arcs = search(reduced(gray, factor), mask, before and before.reduced(factor)).scaled(factor)
    return arcs, lens.follow(arcs, gray.shape, settings)


class Seen(NamedTuple):
    """
    The lines of a frame.

    Attributes
    ----------
    arcs
        The arcs, in px of the frame; with the columns of a tracker where lines are tracked.
    model
        The lens after this frame, None while it is unknown.
    tails
        The last positions of the tracks, as many as the parameter ``trails`` says.

    """

    arcs: Arcs
    model: DivisionModel | None
    tails: Tails


class FrameSequence:
    """
    Successive frames of one camera, video or bag; one thread calls :meth:`find`.

    Parameters may differ from frame to frame: identities go on, also after frames without
    tracking.

    Attributes
    ----------
    lens
        State of the camera's lens.
    circle
        The image circle of the last frame, px of the frame; None where none was found.

    """

    def __init__(self) -> None:
        """Begin without tracks and without a lens."""
        self.lens = CameraLens()
        self.circle: ImageCircle | None = None
        self._detector, self._tracker, self._trails = Detector(), Tracker(), Trails()

    def find(self, gray: np.ndarray, parameters: Parameters, settings: Settings) -> Seen:
        """Find the lines of the next frame, (H, W) uint8; errors are those of :func:`find`."""
        self.circle = None
        finder = self._finder(parameters, settings)
        search = finder.track if isinstance(finder, Tracker) else finder.detect
        arcs, model = find(gray, search, settings, self.lens)
        factor = view(settings, *gray.shape).factor
        self.circle = finder.circle and finder.circle.scaled(factor)
        return Seen(arcs, model, self._trails.follow(arcs, settings.trails))

    def _finder(self, parameters: Parameters, settings: Settings) -> Detector | Tracker:
        """Return the tracker or the detector, with the parameters of this frame."""
        finder = self._tracker if tracks_lines(parameters, settings) else self._detector
        finder.parameters = parameters
        return finder

    def circle_values(self) -> dict[str, str]:
        """Return the image circle of the last frame as keys and values of diagnostics."""
        circle = self.circle    # read once: the detection thread may replace it meanwhile
        return {} if circle is None else {'image circle (px)': described(circle)}


def described(circle: ImageCircle) -> str:
    """Return centre and radius of an image circle as a text."""
    return f'centre {circle.x:.1f}, {circle.y:.1f}, radius {circle.radius:.1f}'
