"""The lens from frame to frame: soon there, steady, and not led astray."""
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from qflsd_ros.core import Arcs, Detector, DivisionModel, estimate_distortion
from qflsd_ros.core.lens.tracker import (
    DEVIATIONS, EVERY, LensTracker, PATIENCE, ROOM, START)
from qflsd_ros.sources import Scene
from seen import arcs_of, edge, edges, wheels

SHAPE = (480, 640)


def frames(lam: float, count: int, first: int = 0, arcs: int = 40) -> list[Arcs]:
    """Return frames of a camera that moves fast: other edges in each."""
    lens = DivisionModel(lam, SHAPE)
    return [arcs_of(edges(lens, arcs, seed), seed=seed) for seed in range(first, first + count)]


def follow(tracker: LensTracker, images: list[Arcs]) -> np.ndarray:
    """Return lambda after each frame, nan before it is known."""
    found = []
    for arcs in images:
        tracker.add(arcs, SHAPE)
        found.append(tracker.estimate.lam if tracker.estimate else np.nan)
    return np.array(found)


@pytest.mark.parametrize('lam', [-0.15, -0.8])
def test_on_a_moving_camera_it_settles_within_30_frames(lam):
    scene, detector, tracker = Scene(640, 480, lam=lam), Detector(), LensTracker()
    lambdas = follow(tracker, [detector.detect(scene.image(number)) for number in range(60)])
    assert lambdas[-1] == pytest.approx(lam, abs=3 * tracker.estimate.std)
    assert tracker.estimate.std < 0.01
    assert np.std(lambdas[30:]) < 0.002
    assert np.abs(np.diff(lambdas[30:])).max() < 0.002


def test_its_error_falls_with_other_scenes_and_stays_with_the_same():
    tracker, images = LensTracker(), frames(-0.3, 60)
    follow(tracker, images)
    moving = tracker.estimate.std
    assert tracker.estimate.lam == pytest.approx(-0.3, abs=4 * moving)
    standing = LensTracker()
    follow(standing, images[:1] * 60)
    alone = estimate_distortion(images[:1], SHAPE).std
    assert standing.estimate.std == pytest.approx(alone, rel=1e-6)
    assert moving < 0.4 * alone


def test_frames_of_few_arcs_are_taken_together():
    images = frames(-0.3, 30, arcs=4)
    assert estimate_distortion(images[:1], SHAPE) is None
    lambdas = follow(LensTracker(), images)
    assert np.isnan(lambdas[0]) and lambdas[-1] == pytest.approx(-0.3, abs=0.02)


def bowl(seed: int, place: tuple[float, float] = (0.0, 0.0)) -> Arcs:
    """Return two arcs of a true circle and one straight edge, seen without distortion."""
    turns = np.linspace(0, 1.2, 234) + np.array([[2.85], [4.15]])
    halves = np.array([321.1, 263.5]) + 195.2 * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    flat = DivisionModel(0.0, SHAPE)
    curves = [*halves, edge(flat, np.array([60.0, 80.0]), np.array([240.0, 100.0]))]
    return arcs_of([curve + place for curve in curves], seed=seed)


def test_what_one_frame_does_not_determine_its_repetition_does_not_either():
    """A standing camera sees the same bowl, with other noise in each frame."""
    assert estimate_distortion([bowl(seed) for seed in range(3)], SHAPE).lam < -3
    tracker = LensTracker()
    assert np.isnan(follow(tracker, [bowl(seed) for seed in range(200)])).all()
    # It may tremble, or an edge be missed here and there.
    random = np.random.default_rng(1)
    trembling = [bowl(seed, tuple(random.uniform(-15, 15, 2))) for seed in range(200)]
    assert np.isnan(follow(tracker, trembling)).all()
    few = frames(-0.3, 1, arcs=4)[0], frames(-0.3, 1, arcs=3)[0]
    assert np.isnan(follow(LensTracker(), [*few] * 50)).all()


def test_photographs_that_do_not_determine_the_lens_do_not_if_they_come_again():
    gray = Scene(640, 480, lam=-0.4).image(380)[:200, :300]
    random = np.random.default_rng(2)
    noisy = [np.clip(gray + random.normal(0, 2, (200, 300)), 0, 255).astype(np.uint8)
             for _ in range(12)]
    detector, tracker, shape = Detector(), LensTracker(), (200, 300)
    images = [detector.detect(image) for image in noisy]
    assert all(estimate_distortion([arcs], shape) is None for arcs in images)
    assert estimate_distortion(images, shape) is not None
    for arcs in images * 5:
        tracker.add(arcs, shape)
    assert tracker.estimate is None


def test_a_right_estimate_stays_when_frames_repeat_that_do_not_determine_one():
    tracker = LensTracker()
    follow(tracker, frames(-0.3, 10))
    before = tracker.estimate
    follow(tracker, [bowl(seed) for seed in range(600)])
    assert tracker.estimate == before and tracker.outliers == 0
    # Not either with views that differ, which determine one together.
    moved = [bowl(seed, place) for seed in range(200) for place in ((0, 0), (90, 0), (0, -90))]
    follow(tracker, moved)
    assert tracker.estimate.lam == pytest.approx(-0.3, abs=0.005)


def test_memory_is_bounded_and_forgets(monkeypatch):
    monkeypatch.setattr('qflsd_ros.core.lens.tracker.MEMORY', 20)
    monkeypatch.setattr('qflsd_ros.core.lens.tracker.EVERY', 1)
    monkeypatch.setitem(DEVIATIONS, 1, np.inf)
    tracker = LensTracker()
    follow(tracker, frames(-0.30, 40))
    lambdas = follow(tracker, frames(-0.31, 100, first=40))
    assert lambdas[0] == pytest.approx(-0.30, abs=0.002)
    assert lambdas[-1] == pytest.approx(-0.31, abs=0.002)
    lens = DivisionModel(-0.3, SHAPE)
    short = arcs_of(edges(lens, 300, 1, (20, 25)))
    for _ in range(8):
        tracker.add(short, SHAPE)
    assert len(tracker._waiting) <= ROOM + len(short)


def test_outliers_are_left_out():
    tracker = LensTracker()
    follow(tracker, frames(-0.3, 10))
    before = tracker.estimate
    wrong = frames(-0.6, 3)
    follow(tracker, wrong + [arcs_of(wheels(DivisionModel(0.0, SHAPE), 30, 1))])
    assert tracker.outliers == 3 and tracker.estimate == before
    follow(tracker, frames(-0.3, 10, first=50))
    assert tracker.outliers == 3 and tracker.estimate.lam == pytest.approx(-0.3, abs=0.005)


def test_another_lens_is_taken_for_one_after_a_while():
    tracker = LensTracker()
    follow(tracker, frames(-0.3, 10))
    lambdas = follow(tracker, frames(-0.6, 30, first=10))
    assert lambdas[3] == pytest.approx(-0.3, abs=0.005)
    assert lambdas[-1] == pytest.approx(-0.6, abs=0.01)


def test_later_on_most_frames_are_passed_over_until_one_tells_another_lens():
    tracker = LensTracker()
    lambdas = follow(tracker, frames(-0.3, START + 3 * EVERY))
    changes = np.diff(lambdas) != 0
    assert changes[:START - 1].all() and changes[START - 1:].sum() == 3
    lambdas = follow(tracker, frames(-0.6, EVERY + PATIENCE, first=100))
    assert lambdas[0] == pytest.approx(-0.3, abs=0.005)
    assert lambdas[-1] == pytest.approx(-0.6, abs=0.01)


def test_another_size_starts_anew():
    tracker = LensTracker()
    follow(tracker, frames(-0.3, 5))
    tracker.add(Arcs.empty(), (240, 320))
    assert tracker.estimate is None


def test_the_centre():
    lens = DivisionModel(-0.4, SHAPE, (335.0, 230.0))
    tracker = LensTracker(centre=True)
    follow(tracker, [arcs_of(edges(lens, 40, seed), seed=seed) for seed in range(20)])
    estimate = tracker.estimate
    assert np.abs(estimate.model.origin - lens.origin).max() < 5 * estimate.centre_std < 10
    assert estimate.lam == pytest.approx(-0.4, abs=5 * estimate.std)


def through(lens: DivisionModel, count: int, first: int = 0) -> list[Arcs]:
    return [arcs_of(edges(lens, 40, seed), seed=seed) for seed in range(first, first + count)]


@pytest.mark.parametrize('lam', [-0.2, -0.8])
def test_a_centre_that_moves_is_noticed(lam):
    lens, other = DivisionModel(lam, SHAPE), DivisionModel(lam, SHAPE, (369.5, 219.5))
    tracker = LensTracker(centre=True)
    follow(tracker, through(lens, 60))
    assert tracker.outliers == 0
    follow(tracker, through(other, EVERY + 30, first=100))
    estimate = tracker.estimate
    off = np.abs(estimate.model.origin - other.origin)
    assert off.max() < 4 * estimate.centre_std < 12
    assert estimate.lam == pytest.approx(lam, abs=4 * estimate.std)


def test_a_centre_and_lambda_are_judged_together():
    """Each is within its deviation, together they are not: their errors go together."""
    tracker = LensTracker(centre=True)
    follow(tracker, through(DivisionModel(-0.4, SHAPE), 1))
    known = tracker.estimate
    spread, axes = np.linalg.eigh(known.covariance)
    values = np.array([known.lam, *known.model.origin])
    for axis, size in ((0, 3.0), (0, 8.0), (2, 3.0), (2, 8.0)):
        lam, *centre = values + size * np.sqrt(spread[axis]) * axes[:, axis]
        frame = replace(known, model=DivisionModel(lam, SHAPE, tuple(centre)))
        assert tracker._is_outlier(frame) == (size == 8)


def test_the_scatter_of_frames_counts_beyond_their_own_deviations():
    """A lens whose centre breathes by 3 px, which makes few frames outliers."""
    shifts, tracker = np.random.default_rng(3).normal(0, 3, (100, 2)), LensTracker(centre=True)
    for number, shift in enumerate(shifts):
        lens = DivisionModel(-0.2, SHAPE, tuple((319.5, 239.5) + shift))
        tracker.add(arcs_of(edges(lens, 40, number), seed=number), SHAPE)
    assert tracker.outliers <= 3
    stated = tracker.estimate.centre_std
    assert np.abs(tracker.estimate.model.origin - (319.5, 239.5)).max() < 4 * stated
    taken = START + (len(shifts) - START) // EVERY
    assert 0.9 * 3 / np.sqrt(taken) < stated < 3


def test_frames_without_arcs_change_nothing():
    tracker = LensTracker()
    tracker.add(Arcs.empty(), SHAPE)
    assert tracker.estimate is None
    follow(tracker, frames(-0.3, 5))
    before = tracker.estimate
    tracker.add(Arcs.empty(), SHAPE)
    assert tracker.estimate == before
