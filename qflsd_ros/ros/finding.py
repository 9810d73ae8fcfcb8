"""Detection in successive frames of one camera; imports no ROS."""
from __future__ import annotations

import numpy as np
from qflsd_ros.core import Arcs, Detector
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.ros.input.region import reduced, view
from qflsd_ros.ros.lens import CameraLens
from qflsd_ros.ros.parameters.node_parameters import Settings


def find(gray: np.ndarray, detector: Detector, settings: Settings,
         lens: CameraLens) -> tuple[Arcs, DivisionModel | None]:
    """
    Detect the arcs of the next frame, using the lens as known from the frames before.

    Parameters
    ----------
    gray
        (H, W) uint8.
    detector
        A detector that no other thread uses.
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
    arcs = detector.detect(reduced(gray, factor), mask,
                           before and before.reduced(factor)).scaled(factor)
    return arcs, lens.follow(arcs, gray.shape, settings)
