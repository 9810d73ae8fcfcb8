"""The lens, estimated and used by the detector as a process over real DDS."""
from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import pytest
from qflsd_ros.core import Arcs, Detector, DivisionModel
from qflsd_ros.core.lens.tracker import LensTracker
from qflsd_ros.ros.output import clouds
from qflsd_ros.sources import Scene
from rig import BLACK, image, Rig, same, values

if TYPE_CHECKING:
    from conftest import Peer

ROOM = Scene(640, 480, lam=-0.4)


def rectifying_map(info: object) -> np.ndarray:
    """Return the map that a rectifying node uses, (H, W, 2) px: the source of each pixel."""
    assert info.distortion_model == 'rational_polynomial'
    k, p = np.reshape(info.k, (3, 3)), np.reshape(info.p, (3, 4))[:, :3]
    return np.stack(cv2.initUndistortRectifyMap(
        k, np.array(info.d), np.reshape(info.r, (3, 3)), p, (info.width, info.height),
        cv2.CV_32FC1), axis=-1)


def straightened(lam: float) -> np.ndarray:
    """Return the exact map of a lens, (480, 640, 2) px."""
    y, x = np.mgrid[:480, :640]
    return DivisionModel(lam, (480, 640)).distort(np.stack([x, y], axis=-1))


def test_the_lens_is_estimated_fixed_and_off(peer: Peer) -> None:
    rig = Rig(peer, listen=('arcs', 'camera_info', 'rectified', 'segments'), lens='estimate'
              ).ready()
    rig.show(image(BLACK), 'no lens: the lens is not known yet')
    assert rig.report('no lens').level == DiagnosticStatus.WARN

    picture = image(ROOM.image(400))
    info = rig.detect(picture, 'camera_info')
    found = values(rig.report('lens lambda deviation'))
    lam, deviation = (float(found[f'lens lambda{key}']) for key in ('', ' deviation'))
    assert lam == pytest.approx(-0.4, abs=4 * deviation) and deviation < 0.02
    assert np.abs(rectifying_map(info) - straightened(lam)).max() < 0.2
    straight = clouds.records(rig.detect(picture, 'arcs'))['straight']
    assert np.nanmean(straight > 0.5) > 0.8

    rectified, segments = (rig.detect(picture, name) for name in ('rectified', 'segments'))
    assert rectified.fields == segments.fields
    shown = clouds.records(rectified)
    assert len(shown) == 2 * np.count_nonzero(~(straight < 0.5))
    curved = clouds.records(segments)
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
    assert np.isnan(clouds.records(rig.detect(image(ROOM.image(400)), 'arcs'))['straight']).all()
    assert not rig.change(lens='maybe')[0].successful


def differ(arcs: Arcs, others: Arcs) -> bool:
    return len(arcs) != len(others) or not np.array_equal(arcs.table, others.table)


def test_a_fixed_lens_is_made_use_of(peer: Peer) -> None:
    gray, lens = ROOM.image(400), DivisionModel(-0.4, (480, 640))
    plain, known = Detector().detect(gray), Detector().detect(gray, lens=lens)
    assert differ(plain, known)
    rig = Rig(peer, '-p', 'lens_lambda:=-0.4', lens='fixed').ready()
    assert same(rig.detect(image(gray)), known.polylines(0.1))
    assert rig.change(lens='off')[0].successful
    assert same(rig.detect(image(gray)), plain.polylines(0.1))

    assert all(result.successful for result in rig.change(
        lens='fixed', lens_centre_x=300.0, max_width=320))
    gray = gray[:-1]    # the last row fills no block
    small = cv2.resize(gray[:-1], (320, 239), interpolation=cv2.INTER_AREA)
    lens = DivisionModel(-0.4, (479, 640), (300.0, 239.0)).reduced(2)
    known = Detector().detect(small, lens=lens)
    assert differ(known, Detector().detect(small))
    assert same(rig.detect(image(gray)), known.scaled(2).polylines(0.1))


def test_what_the_frames_before_tell_is_made_use_of(peer: Peer) -> None:
    """No topic of the lens has a subscription; the camera changes its size, and back."""
    rig = Rig(peer, lens='estimate').ready()
    rig.detect(image(BLACK))
    pictures = [ROOM.image(number) for number in (400, 410, 420)]
    half = [np.ascontiguousarray(gray[::2, ::2]) for gray in pictures]
    shown = {}
    for gray in pictures + half + pictures[:2]:
        message = image(gray)
        shown[message.header.stamp.sec] = gray
        rig.detect(message)     # may come to the detector several times, each with an answer

    detector, tracker, uses = Detector(), LensTracker(), []
    for answer in rig.received['segments']:
        gray = shown.get(answer.header.stamp.sec, BLACK)
        estimate = tracker.estimate
        known = estimate.model if estimate and estimate.model.shape == gray.shape else None
        arcs = detector.detect(gray, lens=known)
        assert same(answer, arcs.polylines(0.1))
        uses.append(known is not None and differ(arcs, detector.detect(gray)))
        tracker.add(arcs, gray.shape)
    assert sum(uses) >= 4
