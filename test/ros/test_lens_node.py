"""The lens, estimated live: of the detector as a process over real DDS."""
from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import pytest
from qflsd_ros.core import DivisionModel
from qflsd_ros.ros import outputs
from qflsd_ros.sources import Scene
from rig import BLACK, image, Rig, values

if TYPE_CHECKING:
    from conftest import Peer

ROOM = Scene(640, 480, lam=-0.4)


def rectifying_map(info: object) -> np.ndarray:
    """Return what a node that rectifies images looks up for each pixel, (H, W, 2) px."""
    assert info.distortion_model == 'rational_polynomial'
    k, p = np.reshape(info.k, (3, 3)), np.reshape(info.p, (3, 4))[:, :3]
    return np.stack(cv2.initUndistortRectifyMap(
        k, np.array(info.d), np.reshape(info.r, (3, 3)), p, (info.width, info.height),
        cv2.CV_32FC1), axis=-1)


def straightened(lam: float) -> np.ndarray:
    """Return the same of a lens."""
    y, x = np.mgrid[:480, :640]
    return DivisionModel(lam, (480, 640)).distort(np.stack([x, y], axis=-1))


def test_the_lens_is_estimated_fixed_and_off(peer: Peer) -> None:
    rig = Rig(peer, listen=('arcs', 'camera_info', 'rectified', 'segments')).ready()
    rig.show(image(BLACK), 'no lens: the lens is not known yet')
    assert rig.report('no lens').level == DiagnosticStatus.WARN

    picture = image(ROOM.image(400))
    info = rig.detect(picture, 'camera_info')
    found = values(rig.report('lens lambda deviation'))
    lam, deviation = (float(found[f'lens lambda{key}']) for key in ('', ' deviation'))
    assert lam == pytest.approx(-0.4, abs=4 * deviation) and deviation < 0.02
    assert np.abs(rectifying_map(info) - straightened(lam)).max() < 0.2
    straight = outputs.records(rig.detect(picture, 'arcs'))['straight']
    assert np.nanmean(straight > 0.5) > 0.8

    rectified, segments = (rig.detect(picture, name) for name in ('rectified', 'segments'))
    assert rectified.fields == segments.fields
    shown = outputs.records(rectified)
    assert len(shown) == 2 * np.count_nonzero(~(straight < 0.5))
    curved = outputs.records(segments)
    lens = DivisionModel(lam, (480, 640))
    for number in np.unique(shown['segment']):
        ends, arc = shown[shown['segment'] == number], curved[curved['segment'] == number]
        wanted = lens.undistort(np.stack([arc['x'], arc['y']], axis=1))[[0, -1]]
        assert np.hypot(ends['x'] - wanted[:, 0], ends['y'] - wanted[:, 1]).max() < 3

    assert all(result.successful for result in rig.change(
        lens='fixed', lens_lambda=-0.2, focal_length=250))
    info = rig.detect(image(BLACK), 'camera_info')
    assert info.k[0] == 250 and (info.width, info.height) == (320, 240)
    info = rig.detect(image(ROOM.image(400)), 'camera_info')
    assert np.abs(rectifying_map(info) - straightened(-0.2)).max() < 0.05

    assert rig.change(lens='off')[0].successful
    rig.show(image(BLACK), 'no lens: parameter lens is off')
    assert np.isnan(outputs.records(rig.detect(image(ROOM.image(400)), 'arcs'))['straight']).all()
    assert not rig.change(lens='maybe')[0].successful
