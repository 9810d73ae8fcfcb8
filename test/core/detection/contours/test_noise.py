"""The noise of an image, known where it was put there."""
from __future__ import annotations

import cv2
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from qflsd_ros.core.detection.contours import noise
from rendering import half_plane, render

seeds = st.integers(0, 999)


def noisy(sigma: float, seed: int, shape: tuple[int, int] = (240, 320)) -> np.ndarray:
    """Return a grey ramp with white noise of a known deviation."""
    ramp = np.add.outer(np.linspace(60, 120, shape[0]), np.linspace(0, 60, shape[1]))
    noise_only = np.random.default_rng(seed).normal(0, sigma, shape)
    return np.clip(np.rint(ramp + noise_only), 0, 255).astype(np.uint8)


@given(st.sampled_from([2.0, 5.0, 10.0]), seeds)
def test_white_noise_is_measured(sigma, seed):
    # The flattest tenth of the blocks is below the mean of all.
    assert 0.75 * sigma < noise.estimate(noisy(sigma, seed)) < sigma


@given(st.floats(-np.pi, np.pi))
def test_edges_are_no_noise(angle):
    assert noise.estimate(render((200, 240), half_plane(119.5, 99.5, angle))) < 0.3


def test_what_is_saturated_tells_nothing():
    gray = noisy(6, 0)
    gray[:, :200] = 0
    assert 4.5 < noise.estimate(gray) < 6
    assert noise.estimate(np.full((50, 50), 255, np.uint8)) == 0


@given(st.sampled_from([2.0, 5.0, 10.0]), seeds, st.sampled_from([1, 16, 128]),
       st.sampled_from([np.s_[:15], np.s_[-40:], np.s_[100:130], np.s_[:, :60], np.s_[:, 250:],
                        np.s_[30:150, 40:200]]))
def test_flat_bands_and_patches_are_no_noise_free_image(sigma, seed, level, where):
    gray = noisy(sigma, seed)
    gray[where] = level
    assert 0.7 * sigma < noise.estimate(gray) < 1.05 * sigma


def test_an_upright_film_between_bars():
    gray = np.full((180, 320), 16, np.uint8)
    gray[:, 110:211] = noisy(5, 0, (180, 101))
    assert 3 < noise.estimate(gray) < 5.2


@given(st.floats(-np.pi, np.pi), st.integers(1, 3), st.integers(0, 60))
def test_a_clean_image_of_any_edges_has_none(angle, count, flat):
    across = 200 / count
    gray = render((200, 240), lambda u, v: across / 4 - np.abs(
        half_plane(0, 0, angle)(u, v) % across - across / 2))
    gray[:flat] = 16
    assert noise.estimate(gray) < 0.3


@given(arrays(np.uint8, st.tuples(st.integers(1, 40), st.integers(1, 40))))
def test_any_image_has_some(gray):
    assert 0 <= noise.estimate(gray) < 8 * 255


@pytest.mark.parametrize('blur_sigma', [0.6, 1.0, 1.7])
def test_noise_of_gradients(blur_sigma):
    gray = np.random.default_rng(0).normal(128, 5, (400, 400)).astype(np.float32)
    blurred = cv2.GaussianBlur(gray, (0, 0), blur_sigma)
    measured = cv2.Sobel(blurred, cv2.CV_32F, 1, 0, scale=0.25).std()
    assert np.isclose(noise.of_gradient(5, blur_sigma), measured, rtol=0.1)


def test_more_noise_is_blurred_more():
    assert noise.blur(0.6, 0) == 0.6 < noise.blur(0.6, 5) < noise.blur(0.6, 10)


@given(st.integers(5, 20), st.floats(0, 100), st.floats(0, 100))
def test_noise_breaks_edges_into_shorter_pieces(usual, one, other):
    less, more = sorted((one, other))
    assert noise.min_points(usual, 0) == usual
    assert usual >= noise.min_points(usual, less) >= noise.min_points(usual, more) >= noise.FEWEST
    assert noise.min_points(usual, 100) == noise.FEWEST
