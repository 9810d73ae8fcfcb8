"""The arcs of one frame after the other of a camera; imports no ROS."""
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
    Find the arcs of the next frame with the lens that is known before it.

    Parameters
    ----------
    gray
        (H, W) uint8.
    detector
        Of the thread that calls.
    settings
        Region, mask and largest width of the image, and how the lens is known.
    lens
        Of the camera; it follows the frame.

    Returns
    -------
    arcs
        In px of ``gray``.
    model
        The lens as it is known with this frame, None where it is not.

    Raises
    ------
    ViewError
        The region lies outside, or the mask has another size.
    SourceError
        The mask cannot be read and :func:`read_mask` has not been called before.

    """
    factor, mask = view(settings, *gray.shape)
    before = lens.known(gray.shape, settings)
    arcs = detector.detect(reduced(gray, factor), mask,
                           before and before.reduced(factor)).scaled(factor)
    return arcs, lens.follow(arcs, gray.shape, settings)
