"""Region, mask and scale, of the detector as a process over real DDS."""
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from qflsd_ros.core import Detector, Parameters
from qflsd_ros.ros.output import clouds
from rig import EXPECTED, image, Rig, same, SCENE

if TYPE_CHECKING:
    from conftest import Peer


def fisheye() -> np.ndarray:
    """Return SCENE inside a bright circle on a black background."""
    gray = np.where(SCENE == 60, 90, SCENE).astype(np.uint8)
    gray[~disc(118)] = 0
    return gray


def disc(radius: int) -> np.ndarray:
    y, x = np.indices(SCENE.shape)
    return np.hypot(x - 160, y - 120) < radius


def write_mask(peer: Peer, mask: np.ndarray) -> str:
    path = peer.folder / 'mask.png'
    cv2.imwrite(str(path), np.uint8(255) * mask)
    return str(path)


def points_of(message: clouds.PointCloud2) -> np.ndarray:
    return np.concatenate([np.zeros((0, 2), np.float32), *clouds.polylines(message)])


def test_the_rim_of_the_image_circle_is_not_reported(peer: Peer) -> None:
    mask = disc(114)
    path = write_mask(peer, mask)
    rig = Rig(peer, '-p', f'mask:={path}').ready()
    Path(path).unlink()  # it is read at the start, and never again
    gray = fisheye()
    message = rig.detect(image(gray))
    assert same(message, Detector().detect(gray, mask).polylines(0.1))
    away = np.hypot(*(points_of(message) - (160, 120)).T)
    assert len(away) and away.max() < 114
    everything = Detector(Parameters(image_circle='off')).detect(gray)
    assert np.hypot(*(np.concatenate(everything.polylines()) - (160, 120)).T).max() > 117
    # Nobody can make the node read another file.
    result, = rig.change(mask='/etc/passwd')
    assert not result.successful and result.reason
    # Images of another size than the mask are named, and the next good one works.
    rig.show(image(gray[:100]), 'has 320 x 240 pixels: must have 320 x 100, like the image')
    assert same(rig.detect(image(gray)), Detector().detect(gray, mask).polylines(0.1))


def test_no_arc_crosses_what_is_masked(peer: Peer) -> None:
    """A masked strut that is narrower than max_gap does not split a long edge."""
    mask = np.ones(SCENE.shape, bool)
    mask[:, 200:206] = False
    gray = np.where(np.indices(SCENE.shape)[0] > 100, 200, 50).astype(np.uint8)
    assert len(Detector().detect(gray)) == 1
    rig = Rig(peer, '-p', f'mask:={write_mask(peer, mask)}').ready()
    left, right = sorted(clouds.polylines(rig.detect(image(gray))), key=lambda line: line[0, 0])
    assert left[:, 0].max() < 200 and right[:, 0].min() > 205


def test_a_region_can_be_moved_while_it_runs(peer: Peer) -> None:
    rig = Rig(peer, '-p', 'roi_width:=100').ready()
    for x, width in ((0, 100), (160, 0), (20, 200)):
        assert all(result.successful for result in rig.change(roi_x=x, roi_width=width))
        found = points_of(rig.detect(image(SCENE)))
        assert len(found) > 2
        assert x - 0.5 <= found[:, 0].min() and found[:, 0].max() <= x + (width or 320) - 0.5
    rig.change(roi_x=320)
    rig.show(image(SCENE), 'region begins at roi_x 320, roi_y 0: must begin inside')
    assert rig.report('region outside').level == DiagnosticStatus.WARN
    rig.change(roi_x=0, roi_width=0)
    assert same(rig.detect(image(SCENE)), EXPECTED)


def test_a_smaller_image_gives_results_of_the_full_one(peer: Peer) -> None:
    gray = cv2.GaussianBlur(cv2.resize(SCENE, None, fx=4, fy=4), (0, 0), 2)
    rig = Rig(peer, '-p', 'max_width:=320', listen=('segments', 'overlay', 'markers')).ready()
    found = rig.detect(image(gray))
    small = cv2.resize(gray, (320, 240), interpolation=cv2.INTER_AREA)
    assert same(found, Detector().detect(small).scaled(4).polylines(0.1))
    # What is found lies where the full image has it.
    full = [line for line in Detector().detect(gray).polylines() if len(line) == 2]
    straight = [line for line in clouds.polylines(found) if len(line) == 2]
    assert len(straight) >= 3
    for line in straight:
        across = np.array([-1, 1]) * (line[1] - line[0])[::-1] / np.hypot(*(line[1] - line[0]))
        assert min(np.abs((other - line[0]) @ across).max() for other in full) < 1
    assert rig.detect(image(gray), 'overlay').width == 1280
    # The region counts pixels of the full image.
    rig.change(roi_x=900)
    assert 899 < points_of(rig.detect(image(gray)))[:, 0].min()
