"""Attitude over time: axes keep their order, and one focal length comes from many views."""
from __future__ import annotations

import dataclasses

from hypothesis import given, HealthCheck, settings, strategies
from manhattan import angle, clutter, place, SHAPE, turned
import numpy as np
import pytest
from qflsd_ros.core import Arcs, AttitudeTracker, Detector, DivisionModel
from qflsd_ros.core.attitude.tracker import GAP, matched, PATIENCE
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.tracker import LensTracker
from qflsd_ros.sources import Scene
from qflsd_ros.sources.scene.optics import FOCAL
from seen import arcs_of

LENS = DivisionModel(0.0, SHAPE)


def seen(yaw: float, pitch: float = 0.25, focal: float = 450.0, seed: int = 0) -> Arcs:
    return place(turned(yaw, pitch, 0.05), focal, seed=seed)


def world(found, view: np.ndarray) -> np.ndarray:
    """Return the axes in the place, rows."""
    return found.directions[:3] @ view.T


@pytest.mark.slow
def test_axes_keep_order_and_sign_over_a_whole_turn():
    tracker, first = AttitudeTracker(), None
    for step in range(90):
        yaw = 0.6 + np.radians(4 * step)
        found = tracker.add(seen(yaw, seed=step), SHAPE, LENS)
        assert found is not None, tracker.reason
        axes = world(found, turned(yaw, 0.25, 0.05))
        first = axes if first is None else first
        assert np.linalg.det(found.directions[:3]) == pytest.approx(1)
        assert (axes * first).sum(axis=1).min() > np.cos(np.radians(4))


@settings(max_examples=50, deadline=None, suppress_health_check=list(HealthCheck))
@given(strategies.permutations(range(3)),
       strategies.tuples(*[strategies.sampled_from((-1, 1))] * 3),
       strategies.floats(-0.6, 0.6), strategies.floats(-0.3, 0.3))
def test_matching_undoes_any_order_and_signs(order, signs, yaw, pitch):
    last = turned(0.2, 0.1, 0.0)
    axes = last @ turned(yaw, pitch, 0.0)
    mixed = (axes * np.array(signs)[:, None])[list(order)]
    assert np.allclose(matched(mixed, last), axes)


def test_up_is_followed_beyond_45_degrees_from_the_hint():
    tracker = AttitudeTracker()
    for step in range(36):
        pitch = np.radians(2.0 * step)
        found = tracker.add(seen(0.6, pitch, seed=step), SHAPE, LENS)
        assert found is not None and found.up is not None
        assert angle(found.up, -turned(0.6, pitch, 0.05)[1]) < 3


def test_a_gap_is_survived_and_its_reason_told():
    tracker = AttitudeTracker()
    before = tracker.add(seen(0.6), SHAPE, LENS).directions[:3]
    noise = arcs_of(clutter(60, np.random.default_rng(0)))
    for _ in range(GAP // 2):
        assert tracker.add(noise, SHAPE, LENS) is None
        assert 'log likelihood' in tracker.reason
    assert tracker.add(Arcs.empty(), SHAPE, LENS) is None
    assert tracker.reason == '0 arcs, must be at least 12'
    after = tracker.add(seen(0.6, seed=1), SHAPE, LENS)
    assert tracker.reason == '' and tracker.focal is not None
    assert (before * after.directions[:3]).sum(axis=1).min() > 0.99


def test_after_a_long_gap_up_comes_from_the_hint():
    tracker = AttitudeTracker()
    tracker.add(seen(0.6), SHAPE, LENS)
    for _ in range(GAP + 1):
        tracker.add(Arcs.empty(), SHAPE, LENS)
    found = tracker.add(place(turned(0.6, 0.1, 0.0), 450.0, seed=3), SHAPE, LENS)
    assert angle(found.up, -turned(0.6, 0.1, 0.0)[1]) < 3


@pytest.mark.slow
def test_one_scene_counts_once_and_others_average():
    still, moving = AttitudeTracker(), AttitudeTracker()
    for step in range(40):
        still.add(seen(0.6), SHAPE, LENS)
        moving.add(seen(0.4 + 0.1 * (step % 8), 0.2 + 0.01 * step, seed=step), SHAPE, LENS)
    alone = AttitudeTracker()
    alone.add(seen(0.6), SHAPE, LENS)
    assert still.focal[1] == pytest.approx(alone.focal[1])
    assert abs(moving.focal[0] - 450) < min(3 * moving.focal[1], 0.01 * 450)


def test_a_zoom_is_noticed():
    tracker = AttitudeTracker()
    for step in range(10):
        tracker.add(seen(0.4 + 0.08 * step, seed=step), SHAPE, LENS)
    for step in range(PATIENCE + 5):
        tracker.add(seen(0.4 + 0.03 * step, focal=700.0, seed=step), SHAPE, LENS)
    assert abs(tracker.focal[0] - 700) < 30


def test_another_size_starts_anew():
    tracker = AttitudeTracker()
    tracker.add(seen(0.6), SHAPE, LENS)
    assert tracker.focal is not None
    assert tracker.add(Arcs.empty(), (240, 320)) is None
    assert tracker.focal is None


def test_the_hint_needs_a_direction():
    with pytest.raises(ValueError, match='up_hint'):
        AttitudeTracker((0.0, 0.0, 0.0))


@pytest.mark.slow
@pytest.mark.parametrize('lam', [-0.3, -0.6, -0.9])
def test_the_rendered_room(lam):
    """A camera that turns by 27 degrees in 3 s."""
    scene, detector = Scene(640, 480, lam, 2.0), Detector()
    lenses, tracker, headings = LensTracker(), AttitudeTracker(), []
    for number in range(0, 90, 2):
        arcs = detector.detect(scene.image(number))
        lenses.add(arcs, SHAPE)
        found = tracker.add(arcs, SHAPE, lenses.estimate)
        camera = scene._camera(number).axes
        assert angle(found.up, camera[:, 2]) < 0.3
        headings.append(found.directions[1] @ camera)
    assert abs(tracker.focal[0] / (FOCAL * scene.lens.half_diagonal) - 1) < 0.005
    assert min(h @ headings[0] for h in headings) > np.cos(np.radians(1.5))


@pytest.mark.parametrize('first', [300, 900])
def test_a_wall_seen_frontally_has_no_false_certainty(first):
    """Wrong axes, with a moved optical centre, explain some of these views nearly as well."""
    scene, detector = Scene(640, 480, -0.9, 2.0), Detector()
    lenses, tracker, errors = LensTracker(), AttitudeTracker(), []
    for number in range(first, first + 60, 2):
        arcs = detector.detect(scene.image(number))
        lenses.add(arcs, SHAPE)
        found = tracker.add(arcs, SHAPE, lenses.estimate)
        if found is not None and found.up is not None:
            errors.append(angle(found.up, scene._camera(number).axes[:, 2]))
            assert errors[-1] < 3 * np.degrees(found.up_std)
    assert len(errors) > 20 and np.median(errors) < 0.1


@pytest.mark.parametrize('model', ['plumb_bob', 'equidistant'])
def test_a_calibrated_camera(model):
    """The true calibration of a lens without distortion, and an equidistant one bent by it."""
    matrix = np.array([[450.0, 0, 319.5], [0, 450.0, 239.5], [0, 0, 1]])
    arcs, camera = seen(0.6), CameraModel('plumb_bob', matrix, np.zeros(5))
    if model == 'equidistant':
        camera = CameraModel(model, matrix, np.zeros(4))
        arcs = through(arcs, camera)
    found = AttitudeTracker().add(arcs, SHAPE, camera)
    assert found.focal == pytest.approx(450.0) and found.focal_std == 0.0
    assert angle(found.up, -turned(0.6, 0.25, 0.05)[1]) < 0.5
    points = np.array([[100.0, 80.0]])
    assert np.allclose(found.rays(points), camera.rays(points))


def through(arcs: Arcs, camera: CameraModel) -> Arcs:
    """Return the arcs of a pinhole camera as an equidistant one of the same K sees them."""
    table, k = arcs.table.copy(), camera.matrix
    for name in ('start', 'middle', 'end'):
        rays = np.column_stack([(table[name] - k[:2, 2]) / k[0, 0], np.ones(len(table))])
        radius = np.hypot(*rays[:, :2].T)
        table[name] = k[:2, 2] + k[0, 0] * rays[:, :2] * (np.arctan(radius) / radius)[:, None]
    return dataclasses.replace(arcs, table=table)


def test_a_calibrated_camera_has_its_focal_length():
    camera = CameraModel('plumb_bob', np.diag([450.0, 450.0, 1.0]), np.zeros(5))
    with pytest.raises(ValueError, match='beside a calibrated camera'):
        AttitudeTracker().add(seen(0.6), SHAPE, camera, 450.0)
