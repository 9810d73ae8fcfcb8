"""A turning camera: points are carried to where the image shows them."""
from __future__ import annotations

from benchmark.metrics import sample
from benchmark.scenes.turning import Turning
import cv2
import numpy as np
import pytest


@pytest.mark.parametrize('lam', [0.0, -0.6])
def test_points_go_where_the_image_goes(lam):
    """A bright disc is found, in another frame, where its centre is carried."""
    photograph = np.full((240, 320), 40, np.uint8)
    cv2.circle(photograph, (170, 110), 8, 220, -1, cv2.LINE_AA)
    frames = Turning(photograph, lam, 30, 3.0)
    here, there = (_centre(frames.frame(i)) for i in (0, 20))
    assert np.linalg.norm(there - here) > 10
    pieces = sample([np.array([here - [0.5, 0], here + [0.5, 0]])])
    assert frames.carry(pieces, 0, 20).mean(axis=0) == pytest.approx(there, abs=0.3)
    assert frames.carry(pieces, 0, 0) == pytest.approx(pieces.points)


def test_points_out_of_sight_are_nowhere():
    frames = Turning(np.zeros((240, 320), np.uint8), 0.0, 30, 3.0)
    corners = sample([np.array([[5.0, 5], [5, 174]]), np.array([[234.0, 5], [234, 174]])])
    assert np.isnan(frames.carry(corners, 0, 20)).any()


def test_frames_are_the_same_at_each_call():
    frames = Turning(np.full((120, 160), 90, np.uint8), 0.0, 3, 1.0)
    assert np.array_equal(frames.frame(1), frames.frame(1))
    assert not np.array_equal(frames.frame(1), frames.frame(2))


def _centre(image: np.ndarray) -> np.ndarray:
    rows, columns = np.nonzero(image > 120)
    return np.array([columns.mean(), rows.mean()])
