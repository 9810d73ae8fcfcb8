"""Pictures of maps."""
from __future__ import annotations

import numpy as np
from qflsd_ros.map_drawing import draw_map, WIDTH

SQUARE = np.array([[[0.0, 0, 0], [4, 0, 0]], [[4, 0, 0], [4, 2, 0]], [[4, 2, 0], [0, 2, 0]],
                   [[0, 2, 0], [0, 0, 1]]])


def coloured(picture: np.ndarray) -> np.ndarray:
    return np.ptp(picture.astype(int), axis=2) > 60


def test_a_map_alone_has_two_views_below_each_other():
    picture = draw_map(np.arange(4), SQUARE)
    assert picture.shape[1] == WIDTH and picture.dtype == np.uint8
    rows = np.flatnonzero(coloured(picture).any(axis=1))
    # From above the square is half as high as wide, from the side a quarter.
    assert 0.7 * WIDTH < np.ptp(rows) < WIDTH


def test_true_edges_are_beside_and_beneath():
    picture = draw_map(np.zeros(0, int), np.zeros((0, 2, 3)), SQUARE)
    assert picture.shape[1] == 2 * WIDTH
    assert not coloured(picture).any()
    left, right = picture[:, :WIDTH], picture[:, WIDTH:]
    assert left.min() < 100 and (right < 200).sum() > 500


def test_the_same_track_has_the_same_colour():
    one, two = draw_map(np.array([5]), SQUARE[:1]), draw_map(np.array([5, 6]), SQUARE[:2])
    shades, counts = np.unique(one[coloured(one)], axis=0, return_counts=True)
    assert (two == shades[counts.argmax()]).all(axis=2).sum() > 100


def test_nothing_and_far_away_lines_can_be_drawn():
    assert (draw_map(np.zeros(0, int), np.zeros((0, 2, 3))) > 0).any()
    far = np.concatenate([np.tile(SQUARE, (50, 1, 1)), [[[0.0, 0, 0], [1e7, 1e7, 1e7]]]])
    picture = draw_map(np.arange(201), far)
    assert coloured(picture).any() and picture.shape[0] < 3 * WIDTH


def test_lines_on_a_point_can_be_drawn():
    assert draw_map(np.array([1]), np.zeros((1, 2, 3))).shape[1] == WIDTH
