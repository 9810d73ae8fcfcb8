"""Accidents are no arcs; arcs are none by accident."""
from __future__ import annotations

import math

from finding import find, only
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core.detection.validation import (
    CHANCE, closeness, JITTER, SCATTER, score as score_of)
from rendering import half_plane, polygon, render

counts = st.integers(1, 300).flatmap(lambda n: st.tuples(st.just(n), st.integers(0, n)))
numbers = st.integers(9, 10**14)


def score(n: int, k: int, candidates: int) -> float:
    """Return the score of n points of equal weight, k aligned, in quiet surroundings."""
    return score_of(float(n), float(k), 0.0, candidates)


def tail(n: int, k: int) -> float:
    """Return the probability of k or more of n, by the sum of its terms."""
    return math.fsum(math.comb(n, i) * CHANCE ** i * (1 - CHANCE) ** (n - i)
                     for i in range(k, n + 1))


@given(counts, numbers)
def test_score_is_never_above_the_exact_one(count, candidates):
    n, k = count
    exact = -math.log10(tail(n, k)) - math.log10(candidates)
    assert score(n, k, candidates) <= exact + 1e-6


@given(counts, numbers)
def test_more_support_scores_more(count, candidates):
    n, k = count
    if k < n:
        assert score(n, k, candidates) <= score(n, k + 1, candidates)
    assert score(n, k, candidates) >= score(n, k, 2 * candidates)


@given(st.integers(1, 200), numbers)
def test_all_aligned(n, candidates):
    exact = -n * math.log10(CHANCE) - math.log10(candidates)
    assert math.isclose(score(n, n, candidates), exact, abs_tol=1e-9)
    assert math.isclose(score(n, 0, candidates), -math.log10(candidates), abs_tol=1e-9)


distances = st.floats(0, 1)
tolerances = st.floats(0.1, 10)


@given(st.integers(1, 1000), distances, distances, st.floats(0, 0.5), tolerances)
def test_closer_points_score_more(points, one, other, noise, tolerance):
    near, far = (closeness(points, share * tolerance, noise, tolerance)
                 for share in sorted((one, other)))
    assert near >= far


@given(st.integers(1, 1000), st.floats(SCATTER, 1), st.floats(0, 0.5), tolerances)
def test_noise_does_not_speak_against_an_arc(points, share, noise, tolerance):
    noisy = closeness(points, share * tolerance, noise, tolerance)
    assert noisy >= closeness(points, share * tolerance, 0.0, tolerance)


@given(st.integers(1, 1000), st.floats(0, SCATTER), tolerances)
def test_points_that_noise_moves_as_far_tell_nothing(points, share, tolerance):
    noise = SCATTER * tolerance / JITTER
    assert math.isclose(closeness(points, share * tolerance, noise, tolerance), 0, abs_tol=1e-9)


@given(st.integers(1, 1000), tolerances)
def test_points_as_far_as_those_of_an_accident_add_nothing(points, tolerance):
    assert math.isclose(closeness(points, SCATTER * tolerance, 0.0, tolerance), 0, abs_tol=1e-9)


def test_points_that_tell_nothing_leave_the_arcs_looked_at():
    assert score(0, 0, 100) == -2


def test_an_edge_that_wavers_scores_less():
    def wavering(amplitude):
        return lambda u, v: v - 59.5 - amplitude * np.sin(2 * np.pi * u / 12)
    scores = [find(render((120, 60), wavering(amplitude))).table['score'][0]
              for amplitude in (0.0, 0.35, 0.6)]
    assert scores[0] > scores[1] + 2 > scores[2] + 4


@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('sigma', [3, 20, 80])
def test_noise_holds_next_to_nothing(seed, sigma):
    random = np.random.default_rng(seed)
    gray = np.clip(random.normal(128, sigma, (240, 320)), 0, 255).astype(np.uint8)
    assert len(find(gray)) <= 2


def test_random_bits_hold_next_to_nothing():
    gray = 255 * np.random.default_rng(0).integers(0, 2, (240, 320), np.uint8)
    assert len(find(gray)) <= 1


@pytest.mark.parametrize('level', [0, 128, 255])
def test_a_constant_image_holds_nothing(level):
    assert len(find(np.full((120, 160), level, np.uint8))) == 0


def test_a_smooth_slope_holds_nothing():
    gray = np.broadcast_to(np.linspace(0, 255, 400), (300, 400)).astype(np.uint8)
    assert len(find(gray)) == 0


@given(st.floats(-np.pi, np.pi), st.integers(0, 99))
def test_an_edge_in_noise_is_none_by_accident(angle, seed):
    gray = render((120, 160), half_plane(79.5, 59.5, angle), 100, 140, noise=6, seed=seed)
    row = find(gray).table[0]
    assert row['score'] > 20
    assert row['length'] > 90


def test_short_edges_are_found_in_noise():
    side, found = 24.0, 0.0
    for seed, angle in enumerate(np.linspace(0, np.pi / 2, 24, endpoint=False)):
        corners = [(60 + side / np.sqrt(2) * np.cos(angle + turn),
                    60 + side / np.sqrt(2) * np.sin(angle + turn))
                   for turn in np.arange(4) * np.pi / 2]
        square = polygon(corners)
        table = find(render((120, 120), square, 100, 125, noise=8, seed=seed)).table
        on_a_side = np.abs([square(x, y) for x, y in table['middle']]) < 1.5
        found += table['length'][on_a_side].sum() / (4 * side)
    assert found / 24 > 0.85


@given(st.floats(-np.pi, np.pi), st.sampled_from([20, 60, 200]))
def test_contrast_is_the_step(angle, step):
    row = only(find(render((120, 160), half_plane(79.5, 59.5, angle), 30, 30 + step)))
    # Of a step that blur has made wider than the gradient's kernel, a part is missing.
    assert 0.7 * step < row['contrast'] < 1.05 * step


@given(st.floats(-np.pi, np.pi))
def test_the_brighter_side_is_right_of_travel(angle):
    gray = render((120, 160), half_plane(79.5, 59.5, angle))
    for image, heading in ((gray, angle), (255 - gray, angle + np.pi)):
        row = only(find(image))
        assert row['polarity'] == 1
        travel = (row['end'] - row['start']) @ (np.cos(heading), np.sin(heading))
        assert np.isclose(travel, row['length'], rtol=0.01)
