"""The image circle in the node: its parameter, its log line and its diagnostics."""
from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from qflsd_ros.core import Detector, Parameters
from qflsd_ros.ros.parameters.declaration import Settings
from rig import image, Rig, same, SCENE, values

if TYPE_CHECKING:
    from conftest import Peer


def test_the_circle_is_found_reported_and_can_be_switched_off(peer: Peer) -> None:
    """With auto and off the segments are those of the core, of which off finds the rim too."""
    height, width = SCENE.shape
    inside = cv2.circle(np.zeros_like(SCENE), (width // 2, height // 2), int(0.46 * height), 1,
                        cv2.FILLED)
    gray = np.where(inside, 60 + SCENE // 2, 0).astype(np.uint8)
    rig = Rig(peer, listen=('segments',)).ready()
    core = Detector()
    tolerance = Settings().polyline_tolerance
    expected = core.detect(gray).polylines(tolerance)
    without = Detector(Parameters(image_circle='off')).detect(gray).polylines(
        tolerance)
    assert core.circle is not None and len(without) > len(expected) > 0
    assert same(rig.detect(image(gray)), expected)
    rig.peer.until(lambda: 'image circle found: centre' in rig.process.output)
    assert f'radius {core.circle.radius:.1f}' in values(
        rig.report('image circle (px)'))['image circle (px)']
    assert rig.change(image_circle='off')[0].successful
    assert same(rig.detect(image(gray)), without)
    assert not rig.change(image_circle='round')[0].successful
