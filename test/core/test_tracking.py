"""The lens from frame to frame: soon there, steady, and not led astray."""
from __future__ import annotations

import numpy as np
import pytest
from qflsd_ros.core import Arcs, Detector, DivisionModel, estimate_distortion
from qflsd_ros.core import tracking
from qflsd_ros.core.tracking import LensTracker
from qflsd_ros.sources import Scene
from seen import arcs_of, edges, wheels

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


def test_memory_is_bounded_and_forgets(monkeypatch):
    monkeypatch.setattr(tracking, 'MEMORY', 20)
    monkeypatch.setattr(tracking, 'EVERY', 1)
    monkeypatch.setattr(tracking, 'DEVIATIONS', np.inf)
    tracker = LensTracker()
    follow(tracker, frames(-0.30, 40))
    lambdas = follow(tracker, frames(-0.31, 100, first=40))
    assert lambdas[0] == pytest.approx(-0.30, abs=0.002)
    assert lambdas[-1] == pytest.approx(-0.31, abs=0.002)
    lens = DivisionModel(-0.3, SHAPE)
    short = arcs_of(edges(lens, 300, 1, (20, 25)))
    for _ in range(8):
        tracker.add(short, SHAPE)
    assert len(tracker._waiting) <= tracking.ROOM + len(short)


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
    lambdas = follow(tracker, frames(-0.3, tracking.START + 3 * tracking.EVERY))
    changes = np.diff(lambdas) != 0
    assert changes[:tracking.START - 1].all() and changes[tracking.START - 1:].sum() == 3
    lambdas = follow(tracker, frames(-0.6, tracking.EVERY + tracking.PATIENCE, first=100))
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


def test_frames_without_arcs_change_nothing():
    tracker = LensTracker()
    tracker.add(Arcs.empty(), SHAPE)
    assert tracker.estimate is None
    follow(tracker, frames(-0.3, 5))
    before = tracker.estimate
    tracker.add(Arcs.empty(), SHAPE)
    assert tracker.estimate == before
