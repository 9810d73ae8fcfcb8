"""Horizon and axes on an image: where they are drawn, for any attitude and lens."""
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from qflsd_ros.attitude_drawing import ARROW, axes, draw_attitude, HORIZON, horizon
from qflsd_ros.core import Attitude, DivisionModel
from qflsd_ros.overlay import DIRECTIONS

SHAPE = (240, 320)


def attitude(pitch: float = 0.0, roll: float = 0.0, lam: float = 0.0, focal: float = 200.0
             ) -> Attitude:
    """Return the attitude of a camera that looks up by ``pitch``, then turns, radians."""
    cp, sp, cr, sr = np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    up, ahead = np.array([sr * cp, -cr * cp, sp]), np.array([-sr * sp, cr * sp, cp])
    return Attitude(focal, 1.0, up, 0.01, np.stack([up, ahead, np.cross(up, ahead)]),
                    np.zeros(0, np.int64), DivisionModel(lam, SHAPE), 0.0,
                    np.diag([focal, focal, 1.0]))


ATTITUDES = [attitude(0.3, 0.2), attitude(-0.2, 1.5), attitude(0.1, 3.0, -0.6),
             attitude(0.4, -0.7, 0.2), attitude(1.0, 0.5, -3.0, 100.0),
             attitude(-1.6, 0.0, -3.0, 60.0)]
NAMES = ['tilted', 'on its side', 'upside down', 'pincushion', 'fisheye',
         'fisheye that looks down']


@pytest.mark.parametrize('found', ATTITUDES, ids=NAMES)
def test_the_horizon_is_at_right_angles_to_up(found):
    points = horizon(found, SHAPE).reshape(-1, 2)
    assert len(points) > 20
    # The slope of the height is at most about 1 / focal per px.
    assert np.abs(found.rays(points) @ found.up).max() < 0.3 / found.focal


@pytest.mark.parametrize('found', ATTITUDES, ids=NAMES)
def test_the_horizon_is_whole(found):
    """Above it and below it the image is on one side each: every change of side is on it."""
    y, x = np.indices(SHAPE)
    above = found.rays(np.stack([x, y], axis=-1)) @ found.up > 0
    rows, columns = np.nonzero(above[1:] != above[:-1])
    points = horizon(found, SHAPE).mean(axis=1)
    for row, column in list(zip(rows.tolist(), columns.tolist()))[::7]:
        assert np.hypot(*(points - [column, row + 0.5]).T).min() < 8


def test_upside_down_is_the_same_horizon():
    found = attitude(0.3, 0.2, -0.5)
    turned = replace(found, up=-found.up, directions=found.directions * [[-1], [1], [-1]])
    assert np.allclose(horizon(found, SHAPE), horizon(turned, SHAPE))


def test_a_horizon_outside_the_image_is_not_drawn():
    assert len(horizon(attitude(1.2), SHAPE)) == 0


def coloured(picture: np.ndarray, colour: np.ndarray | tuple[int, int, int]) -> np.ndarray:
    """Return the pixels of a colour as (K, 2), x and y."""
    return np.argwhere((picture == colour).all(axis=2))[:, ::-1]


def test_the_drawn_horizon_is_level_for_an_upright_camera():
    picture = np.zeros((*SHAPE, 3), np.uint8)
    draw_attitude(picture, attitude(0.2))
    x, y = coloured(picture, HORIZON).T
    # A camera that looks up sees the horizon below its middle.
    assert np.abs(y - (119.5 + 200 * np.tan(0.2))).max() < 2
    assert np.ptp(x) > 300


def test_without_up_there_are_axes_alone():
    picture = np.zeros((*SHAPE, 3), np.uint8)
    draw_attitude(picture, replace(attitude(0.2, 0.5), up=None, up_std=None))
    assert not len(coloured(picture, HORIZON))
    assert all(len(coloured(picture, DIRECTIONS[axis])) for axis in range(3))


@pytest.mark.parametrize('lam, focal', [(0.0, 200.0), (-0.6, 120.0), (-3.0, 60.0)])
def test_axes_at_right_angles_to_the_view_are_whole(lam, focal):
    found = attitude(0.0, 0.4, lam, focal)
    start, ends = axes(found, SHAPE)
    assert start == pytest.approx([159.5, 119.5])
    arrows = (ends - start) / (ARROW * 240)
    assert arrows == pytest.approx(found.directions[:, :2], abs=0.02)


def test_an_axis_that_points_away_is_short():
    _, (up, ahead, _) = axes(attitude(0.3), SHAPE)
    assert np.hypot(*(up - [159.5, 119.5])) == pytest.approx(ARROW * 240 * np.cos(0.3), rel=0.02)
    assert np.hypot(*(ahead - [159.5, 119.5])) == pytest.approx(ARROW * 240 * np.sin(0.3),
                                                                rel=0.02)


@pytest.mark.parametrize('found', ATTITUDES, ids=NAMES)
def test_drawing_never_fails(found):
    picture = np.zeros((*SHAPE, 3), np.uint8)
    draw_attitude(picture, found, 3)
    assert picture.any()
