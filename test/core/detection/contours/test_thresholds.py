"""How strong the edges of an image are, and what is an edge therefore."""
from __future__ import annotations

import cv2
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from qflsd_ros.core.detection.contours import thresholds
from rendering import half_plane, render


def step(low: float, high: float) -> np.ndarray:
    """Return an upright edge through an image."""
    return render((120, 160), half_plane(79.5, 59.5, 0.3), low, high)


@pytest.mark.parametrize('height', [40.0, 60.0])
def test_a_weak_image_has_the_strength_of_its_edges(height):
    assert thresholds.estimate(step(100, 100 + height)) == pytest.approx(
        height / thresholds.USUAL, abs=0.02)


def test_a_strong_image_has_the_strength_of_its_edges():
    assert thresholds.estimate(step(20, 240)) == pytest.approx(220 / thresholds.USUAL, abs=0.1)


@given(arrays(np.uint8, st.tuples(st.integers(1, 40), st.integers(1, 40))))
def test_any_image_has_some(gray):
    assert thresholds.WEAKEST <= thresholds.estimate(gray) <= thresholds.LARGEST


@given(st.floats(1, 3))
def test_what_is_out_of_focus_is_weak(sigma):
    gray = step(80, 160)
    assert thresholds.estimate(cv2.GaussianBlur(gray, (0, 0), sigma)) < thresholds.estimate(gray)


def test_edges_stand_out_from_the_noise():
    assert thresholds.scale(0.5, 0.0, 10.0) == 0.5
    assert thresholds.scale(0.5, 4.0, 10.0) * 10 == thresholds.ABOVE_NOISE * 4
