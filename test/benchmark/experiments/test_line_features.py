"""Lines count as usable by the gates of PL-VINS, and as one line in space by the true poses."""
from __future__ import annotations

from benchmark.experiments.line_features import Chain, figures, Message, ours
import numpy as np
import pytest
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.sources import Scene

FOCAL = 400.0


def walk(count: int) -> np.ndarray:
    """Return the poses of a camera that moves sideways and turns a little: (N, 4, 4)."""
    poses = np.tile(np.eye(4), (count, 1, 1))
    for i, pose in enumerate(poses):
        cos, sin = np.cos(0.01 * i), np.sin(0.01 * i)
        pose[:3, :3] = [[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]
        pose[:3, 3] = 0.1 * i + 20, 5, -3
    return poses


def seen(poses: np.ndarray, line: np.ndarray) -> list[np.ndarray]:
    """Return the normalised ends of a line in space, (2, 3) relative to (20, 5, -3)."""
    local = [(line + (20, 5, -3) - pose[:3, 3]) @ pose[:3, :3] for pose in poses]
    return [points[:, :2] / points[:, 2:] for points in local]


def test_unbroken_observations_of_one_line_are_usable() -> None:
    poses = walk(10)
    true = seen(poses, np.array([[-1.0, -1, 4], [0.3, 1, 5]]))
    wild = [ends + [[0, 0.05 * (i % 3)]] for i, ends in enumerate(true)]
    messages: list[Message] = [{} for _ in poses]
    for i, message in enumerate(messages):
        message[1] = true[i]
        if i < 6:
            message[2] = wild[i]        # another line each time: 20 px apart
        if i < 4:
            message[3] = true[i]        # too short
        if i not in (3, 7):
            message[4] = true[i]        # broken
    found = figures(messages, poses, FOCAL)
    assert found.lines == pytest.approx((10 + 6 + 4 + 8) / 10)
    assert found.usable == pytest.approx((10 + 6) / 10)
    assert found.in_space == 0.5


def test_without_a_usable_line_there_is_no_share() -> None:
    assert np.isnan(figures([{}, {}], walk(2), FOCAL).in_space)


@pytest.mark.parametrize('make', [ours, Chain])
def test_front_ends_keep_numbers_in_the_room(make) -> None:
    """In a still image most lines have the number of the message before."""
    gray = Scene(640, 480, 0.0).image(300)
    camera = CameraModel('plumb_bob', np.array([[360.0, 0, 319.5], [0, 360, 239.5], [0, 0, 1]]),
                         np.zeros(5))
    take = make(camera, 60.0)
    take(gray, True)
    before, none, after = take(gray, True), take(gray, False), take(gray, True)
    assert not none and len(after) > 20
    assert len(set(before) & set(after)) > 0.8 * len(after)
    both = set(before) & set(after)
    assert np.median([np.abs(before[line] - after[line]).max() for line in both]) < 1e-3
