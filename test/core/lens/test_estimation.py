"""The lens from arcs: exact, honest about its error, and silent where there is nothing to say."""
from __future__ import annotations

import logging

import cv2
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core import Arcs, Detector, DivisionModel, estimate_distortion
from qflsd_ros.core.lens.estimation import estimate_from
from qflsd_ros.core.lens.observation import COLUMNS, CURVATURE, NOISE, NORMAL, POINT, VARIANCE
from qflsd_ros.core.lens.straightness import straightness
from qflsd_ros.sources import Scene
from seen import arcs_of, edge, edges, wheels

SHAPE = (480, 640)
lambdas, seeds = st.floats(-1.5, 0.3), st.integers(0, 10**6)


def spread(lam: float) -> float:
    """Return how much less a change of lambda bends pictures than it does at 0."""
    return (1 - lam / 3) ** 2


@given(lambdas, seeds)
def test_lambda_of_straight_edges(lam, seed):
    lens = DivisionModel(lam, SHAPE)
    found = estimate_distortion([arcs_of(edges(lens, 60, seed), seed=seed)], SHAPE)
    assert abs(found.lam - lam) < min(5 * found.std, 0.02 * spread(lam))
    assert found.model == DivisionModel(found.lam, SHAPE)
    assert 40 <= found.agreeing <= 60 and found.share > 0.95


@given(lambdas, seeds)
def test_wheels_among_the_edges_do_not_win(lam, seed):
    lens = DivisionModel(lam, SHAPE)
    arcs = arcs_of(edges(lens, 30, seed) + wheels(lens, 20, seed))
    found = estimate_distortion([arcs], SHAPE)
    assert abs(found.lam - lam) < min(5 * found.std, 0.02 * spread(lam))
    straight = straightness(arcs, found.model)
    assert straight[:30].min() > 0.5
    assert np.count_nonzero(straight[30:] > 0.5) <= 2
    assert found.share < 0.8


@given(st.floats(-1.5, -0.5), st.floats(150, 230), seeds)
def test_the_rim_of_a_fisheye_is_no_edge(lam, radius, seed):
    lens = DivisionModel(lam, SHAPE)
    turn = np.linspace(0, 1, 60)[:, None] + np.arange(6)
    rim = lens.origin + radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    arcs = arcs_of([*edges(lens, 30, seed), *np.swapaxes(rim, 0, 1)], seed=seed)
    found = estimate_distortion([arcs], SHAPE)
    assert abs(found.lam - lam) < min(5 * found.std, 0.02 * spread(lam))
    assert found.agreeing <= 30 and found.share > 0.9


@given(lambdas, seeds)
def test_neither_turning_nor_scaling_the_image_changes_lambda(lam, seed):
    curves = edges(DivisionModel(lam, SHAPE), 60, seed)
    found = estimate_distortion([arcs_of(curves)], SHAPE)
    turned = [curve[::-1] @ [[0, -1], [1, 0]] + [0, 639] for curve in curves]
    other = estimate_distortion([arcs_of(turned)], SHAPE[::-1])
    assert other.lam == pytest.approx(found.lam, abs=0.01 * spread(lam))
    double = [2 * curve + 0.5 for curve in curves]
    other = estimate_distortion([arcs_of(double, noise=0.1)], (960, 1280))
    assert other.lam == pytest.approx(found.lam, abs=0.01 * spread(lam))


@pytest.mark.parametrize('lam, noise', [(0.0, 0.05), (-0.4, 0.05), (-0.4, 0.2)])
def test_the_standard_deviation_is_honest(lam, noise):
    lens = DivisionModel(lam, SHAPE)
    found = [estimate_distortion([arcs_of(edges(lens, 40, seed), noise, seed)], SHAPE, max_std=1.0)
             for seed in range(60)]
    errors = np.array([(estimate.lam - lam) / estimate.std for estimate in found])
    assert 0.6 < np.sqrt(np.mean(errors ** 2)) < 1.4
    assert abs(errors.mean()) < 0.5


@pytest.mark.parametrize('lam', [-0.1, -0.3, -0.6, 0.2])
@pytest.mark.parametrize('shift', [(0.15, 0.0), (0.0, -0.15), (-0.11, 0.11)])
def test_a_centre_far_off_is_noticed_where_it_is_taken_for_granted(lam, shift, caplog):
    """Shifted by 15 % of the image; the deviation covers what that does to lambda."""
    caplog.set_level(logging.INFO, 'qflsd_ros')
    lens = DivisionModel(lam, SHAPE, (319.5 + 640 * shift[0], 239.5 + 480 * shift[1]))
    for seed in range(20):
        arcs = arcs_of(edges(lens, 40, seed), seed=seed)
        found = estimate_distortion([arcs], SHAPE, max_std=1.0)
        assert abs(found.lam - lam) < 3 * found.std
        assert 'contradict a centre of distortion in the middle' in caplog.text
        caplog.clear()


@pytest.mark.parametrize('lam', [-1.0, -0.3, 0.0, 0.2])
def test_a_centre_in_the_middle_costs_nothing(lam, caplog):
    caplog.set_level(logging.INFO, 'qflsd_ros')
    for seed in range(20):
        arcs = arcs_of(edges(DivisionModel(lam, SHAPE), 40, seed), seed=seed)
        assert estimate_distortion([arcs], SHAPE).std < 0.003 * spread(lam)
    assert not caplog.messages


def test_the_covariance_of_lambda_and_centre_is_honest():
    """Lambda and centre err together as it says: the mean square of their distance by it is 3."""
    lens, squares = DivisionModel(-0.4, SHAPE, (330.0, 232.0)), []
    for seed in range(60):
        arcs = arcs_of(edges(lens, 40, seed), seed=seed)
        found = estimate_distortion([arcs], SHAPE, centre=True, max_std=1.0)
        off = np.array([found.lam - lens.lam, *(found.model.origin - lens.origin)])
        squares.append(off @ np.linalg.solve(found.covariance, off))
        assert found.std ** 2 == pytest.approx(found.covariance[0, 0])
        assert found.centre_std ** 2 == pytest.approx(found.covariance.diagonal()[1:].max())
    assert 0.6 < np.sqrt(np.mean(squares) / 3) < 1.4


def test_images_of_one_camera_together_tell_more():
    lens = DivisionModel(-0.3, SHAPE)
    images = [arcs_of(edges(lens, 12, seed), seed=seed) for seed in range(8)]
    alone = estimate_distortion(images[:1], SHAPE, max_std=1.0)
    together = estimate_distortion(images, SHAPE)
    assert together.std < 0.6 * alone.std and together.agreeing > 4 * alone.agreeing
    assert together.lam == pytest.approx(-0.3, abs=4 * together.std)


@given(st.floats(-1.5, -0.2), st.floats(-0.06, 0.06), st.floats(-0.06, 0.06), seeds)
def test_the_centre_where_it_is_asked_for(lam, x, y, seed):
    middle = DivisionModel(lam, SHAPE)
    shift = middle.half_diagonal * np.array([x, y])
    lens = DivisionModel(lam, SHAPE, tuple(middle.origin + shift))
    arcs = arcs_of(edges(lens, 100, seed))
    found = estimate_distortion([arcs], SHAPE, centre=True)
    assert np.abs(found.model.origin - lens.origin).max() < 6 * found.centre_std < 40
    assert abs(found.lam - lam) < min(5 * found.std, 0.03 * spread(lam))
    assert np.median(straightness(arcs, found.model)) > 0.9


def test_a_centre_that_cannot_be_seen_stays_in_the_middle():
    arcs = arcs_of(edges(DivisionModel(0.0, SHAPE), 100, 1))
    found = estimate_distortion([arcs], SHAPE, centre=True)
    assert np.abs(found.model.origin - DivisionModel(0.0, SHAPE).origin).max() < 5
    assert found.centre_std > 10


def spokes(lens: DivisionModel) -> list[np.ndarray]:
    """Return edges that all pass through the centre."""
    return [edge(lens, lens.origin - 150 * np.array([np.cos(turn), np.sin(turn)]),
                 lens.origin + 150 * np.array([np.cos(turn), np.sin(turn)]))
            for turn in np.linspace(0, 3, 40)]


LENS = DivisionModel(-0.3, SHAPE)


@pytest.mark.parametrize('curves, reason', [
    ([], '0 of 0 arcs are long enough'),
    (edges(LENS, 4, 1), '4 of 4 arcs are long enough'),
    (spokes(LENS), '0 of 40 arcs are long enough and far enough from the centre'),
    (edges(LENS, 100, 1, (10, 14)), 'arcs are long enough'),
    (edges(LENS, 30, 1, (25, 35)), 'with a standard deviation of'),
    (wheels(LENS, 60, 1), 'arcs agree at most')])
def test_what_is_not_observable_is_not_guessed(curves, reason, caplog):
    caplog.set_level(logging.INFO, 'qflsd_ros')
    assert estimate_distortion([arcs_of(curves)], SHAPE) is None
    assert caplog.messages[-1].startswith('lens not observable: ') and reason in caplog.text


@pytest.mark.parametrize('seed', [1389, 1462, 2114])
def test_steps_that_go_astray_end_in_no_lens(seed):
    """Arcs of any curvature anywhere, after which lambda ran away to where nothing tells it."""
    random = np.random.default_rng(seed)
    seen = np.empty((int(random.integers(8, 40)), COLUMNS))
    seen[:, CURVATURE] = random.uniform(-4, 4, len(seen))
    seen[:, NOISE] = seen[:, VARIANCE] = random.choice([1e-4, 1e-2, 0.1], len(seen))
    angle = random.uniform(0, 2 * np.pi, len(seen))
    seen[:, NORMAL:POINT] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    seen[:, POINT:] = random.uniform(-0.7, 0.7, (len(seen), 2))
    assert estimate_from(seen, SHAPE, centre=True) is None


def test_no_image_at_all():
    assert estimate_distortion([], SHAPE) is None
    assert estimate_distortion([Arcs.empty()] * 3, SHAPE) is None


def test_coins_in_an_image_are_not_straight():
    room, coins = Scene(640, 480, lam=-0.4).image(400), [(150, 120, 50), (420, 200, 90)]
    for x, y, radius in coins:
        cv2.circle(room, (x, y), radius, 255, -1, cv2.LINE_AA)
    arcs = Detector().detect(room)
    found = estimate_distortion([arcs], SHAPE)
    assert found.lam == pytest.approx(-0.4, abs=0.02)
    middle, straight = arcs.table['middle'], straightness(arcs, found.model)
    around = np.any([abs(np.hypot(*(middle - (x, y)).T) - radius) < 1.5 for x, y, radius in coins],
                    axis=0) & ~np.isnan(straight)
    assert np.count_nonzero(around) >= 4
    assert np.mean(straight[around] < 0.5) >= 0.8 and np.nanmedian(straight[~around]) > 0.9


def test_from_an_image():
    arcs = Detector().detect(Scene(640, 480, lam=-0.4).image(400))
    found = estimate_distortion([arcs], SHAPE)
    assert found.lam == pytest.approx(-0.4, abs=0.02)
    assert np.nanmedian(straightness(arcs, found.model)) > 0.8
