"""Second views of an image, and how arcs are compared with theirs."""
from __future__ import annotations

import math

from benchmark.experiments import sensitivity
from benchmark.scenes.rendered import room
import numpy as np
import pytest
from qflsd_ros.core import Detector

SHAPE = 240, 320


def test_arcs_are_found_again() -> None:
    """Most of them, under other light and under a homography."""
    gray, detector = room(0, -0.25, SHAPE).gray, Detector()
    arcs = detector.detect(gray).polylines(0.1)
    for there in np.eye(3), sensitivity.homography(SHAPE, 1):
        figures = sensitivity.found_again(detector, gray, arcs, there, 0).figures()
        assert 0.7 < figures.recall <= 1 and figures.rms < 0.5


def test_arcs_out_of_sight_do_not_count() -> None:
    """A second view that shows the left half is compared with arcs in that half alone."""
    gray, detector = room(0, -0.25, SHAPE).gray, Detector()
    left = np.array([[10.0, 30.0], [10.0, 200.0]])
    right = np.array([[310.0, 30.0], [310.0, 200.0]])
    counts = sensitivity.found_again(detector, gray, [left, right], np.diag([2.0, 1.0, 1.0]), 0)
    assert counts.lines == 1 and counts.truth == pytest.approx(170, abs=1)


def test_a_homography_moves_corners_a_little() -> None:
    """Each differently, and the same for the same seed."""
    corners = np.array([[0.0, 0.0], [320.0, 0.0], [320.0, 240.0], [0.0, 240.0]])
    moves = sensitivity.moved(corners, sensitivity.homography(SHAPE, 3)) - corners
    assert (np.abs(moves) < 0.0601 * np.array([320, 240])).all() and len(np.unique(moves)) == 8
    assert (sensitivity.homography(SHAPE, 3) == sensitivity.homography(SHAPE, 3)).all()


@pytest.mark.parametrize(('change', 'text'), [
    (0.0123, '+1.2'), (-0.2, '-20.0'), (-0.0001, '0.0'), (math.nan, '-')])
def test_changes_are_in_hundredths(change: float, text: str) -> None:
    """With their sign."""
    assert sensitivity.hundredths(change) == text
