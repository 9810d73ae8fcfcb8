"""Attitude and focal length: exact, honest about their error, silent where nothing is known."""
from __future__ import annotations

from dataclasses import replace
import logging

import cv2
from manhattan import angle, clutter, pieces, place, scattered, SHAPE, turned
import numpy as np
import pytest
from qflsd_ros.core import (
    Arcs, Detector, DivisionModel, estimate_attitude, estimate_distortion, Parameters)
from qflsd_ros.core.attitude.great_circles import excess, lines, observe
from qflsd_ros.core.attitude.refinement import _accumulate, _move, STATE, UNKNOWNS
from qflsd_ros.sources import Scene
from qflsd_ros.sources.scene.optics import FOCAL
from seen import arcs_of, wheels

VIEW = turned(0.6, 0.25, 0.05)


@pytest.mark.parametrize('lam', [0.0, -0.3, -0.6, 0.1])
@pytest.mark.parametrize('focal', [300.0, 600.0])
def test_focal_length_up_and_directions(lam, focal):
    found = estimate_attitude(place(VIEW, focal, lam), SHAPE, DivisionModel(lam, SHAPE))
    assert abs(found.focal - focal) < min(0.02 * focal, 4 * found.focal_std)
    assert angle(found.up, -VIEW[1]) < 0.5
    assert np.allclose(found.up, found.directions[0])
    for axis in VIEW:
        assert np.abs(found.directions[:3] @ axis).max() > np.cos(np.radians(0.6))
    assert np.allclose(found.directions[:3] @ found.directions[:3].T, np.eye(3))


def test_the_lens_is_estimated_where_it_is_not_given():
    found = estimate_attitude(place(VIEW, 500.0, -0.4, counts=(40, 60, 40)), SHAPE)
    assert abs(found.focal - 500) < 20
    assert abs(found.lens.lam + 0.4) < 0.05


def test_labels_of_all_arcs():
    found = estimate_attitude(place(VIEW, 500.0, counts=(90, 100, 90)), SHAPE,
                              DivisionModel(0.0, SHAPE))
    assert found.labels.shape == (300,)
    truth = np.repeat([0, 1, 2], [90, 100, 90])
    along = np.abs(found.directions[:3] @ VIEW.T).argmax(axis=0)
    assert np.mean(found.labels[:280] == along[truth]) > 0.9
    assert np.mean(found.labels[280:] == -1) > 0.5


def test_further_horizontal_directions():
    random, lens = np.random.default_rng(0), DivisionModel(0.0, SHAPE)
    oblique = (VIEW[0] * np.cos(0.6) + VIEW[2] * np.sin(0.6))[None]
    curves = pieces(VIEW, 500.0, lens, (40, 40, 40), random)
    curves += pieces(oblique, 500.0, lens, (20,), random)
    found = estimate_attitude(arcs_of(curves), SHAPE, lens)
    assert 4 <= len(found.directions) <= 6
    assert abs(found.directions[3] @ oblique[0]) > np.cos(np.radians(1.5))
    assert np.abs(found.directions[3:] @ found.up).max() < 1e-9
    assert np.mean(found.labels[120:] == 3) > 0.8


@pytest.mark.slow
def test_deviations_are_honest():
    focal_z, up_z = [], []
    for seed in range(60):
        random = np.random.default_rng(seed)
        view = turned(random.uniform(0.4, 1.1), random.uniform(-0.35, 0.35),
                      random.uniform(-0.2, 0.2))
        arcs = scattered(place(view, 450.0, seed=seed), seed)
        found = estimate_attitude(arcs, SHAPE, DivisionModel(0.0, SHAPE))
        if found.focal is not None:
            focal_z.append((found.focal - 450) / found.focal_std)
        up_z.append(np.radians(angle(found.up, -view[1])) / found.up_std / np.sqrt(2))
    assert len(focal_z) > 40
    # The priors of lens and centre are about the truth here, so that errors are smaller.
    assert 0.2 < np.sqrt(np.mean(np.square(focal_z))) < 1.3
    assert 0.1 < np.sqrt(np.mean(np.square(up_z))) < 1.3
    assert abs(np.mean(focal_z)) < 3 / np.sqrt(len(focal_z))


def bent(arcs: Arcs, turns: np.ndarray, off: np.ndarray) -> Arcs:
    """Return arcs that turn by angles over half their length, and point past by others."""
    table = arcs.table.copy()
    table['curvature'] += 2 * turns / table['length']
    for name in ('start', 'end'):
        x, y = (table[name] - table['middle']).T
        table[name] += off[:, None] * np.column_stack([-y, x])
    return replace(arcs, table=table)


def test_bent_arcs_count_less():
    """Half of the arcs are bent, and point past their directions as those of photographs do."""
    lens, errors = DivisionModel(0.0, SHAPE), []
    for seed in range(12):
        random = np.random.default_rng(seed)
        arcs = place(VIEW, 500.0, seed=seed)
        turns = np.radians(8.0) * random.uniform(-1, 1, len(arcs)) * (np.arange(len(arcs)) % 2)
        arcs = bent(arcs, turns, 0.6 * turns * random.normal(size=len(arcs)))
        straight = bent(arcs, -turns, np.zeros(len(arcs)))
        errors.append([estimate_attitude(some, SHAPE, lens).camera[0, 0] / 500 - 1
                       for some in (arcs, straight)])
    known, unknown = np.sqrt(np.mean(np.square(errors), axis=0))
    assert known < 0.75 * unknown


@pytest.mark.parametrize('lam', [0.0, -0.5])
def test_the_excess_is_the_angle_beyond_the_image_of_an_edge(lam):
    lens, turn = DivisionModel(lam, SHAPE), np.full(100, np.radians(2.0))
    arcs = place(VIEW, 500.0, lam, others=0)
    more = bent(arcs, turn, np.zeros(100))
    assert excess(arcs, lens, 0.0).mean() < np.radians(0.2)
    assert np.median(excess(more, lens, 0.0)) == pytest.approx(turn[0], rel=0.2)
    # Where lambda is hardly known, it may be the lens that bends edges far from the centre.
    assert excess(more, lens, 0.5).mean() < 0.6 * turn[0]


def test_a_given_focal_length_is_kept():
    found = estimate_attitude(place(VIEW, 500.0), SHAPE, DivisionModel(0.0, SHAPE), 500.0)
    assert found.focal == 500.0 and found.focal_std == 0.0
    assert angle(found.up, -VIEW[1]) < 0.4


def mirrored(arcs: Arcs) -> Arcs:
    """Return the arcs of the mirrored image."""
    table = arcs.table.copy()
    for name in ('start', 'middle', 'end'):
        table[name][:, 0] = SHAPE[1] - 1 - table[name][:, 0]
    table['curvature'] *= -1
    points = arcs.edge_points * [-1, 1] + [SHAPE[1] - 1, 0]
    return replace(arcs, table=table, edge_points=points)


def test_a_mirrored_image_has_the_mirrored_attitude():
    arcs = place(VIEW, 500.0, -0.3)
    one, two = (estimate_attitude(a, SHAPE, DivisionModel(-0.3, SHAPE))
                for a in (arcs, mirrored(arcs)))
    assert abs(one.focal - two.focal) < 0.1 * one.focal_std
    assert angle(one.up * [-1, 1, 1], two.up) < 0.1 * np.degrees(one.up_std)


def test_a_turned_camera_needs_the_hint():
    view = turned(0.6, 0.25, np.pi / 2)
    found = estimate_attitude(place(view, 500.0), SHAPE, DivisionModel(0.0, SHAPE),
                              up_hint=tuple(-view[1]))
    assert angle(found.up, -view[1]) < 0.5


def test_the_same_arcs_give_the_same_attitude():
    arcs = place(VIEW, 500.0, -0.3)
    one, two = (estimate_attitude(arcs, SHAPE) for _ in range(2))
    assert one.focal == two.focal and (one.directions == two.directions).all()
    assert (one.labels == two.labels).all()


def test_rays_look_along_directions():
    found = estimate_attitude(place(VIEW, 500.0, -0.3), SHAPE, DivisionModel(-0.3, SHAPE))
    points = np.array([[100.0, 80.0], [500.0, 300.0]])
    lens = DivisionModel(-0.3, SHAPE)
    truth = np.column_stack([lens.undistort(points) - lens.origin, [500.0, 500.0]])
    truth /= np.linalg.norm(truth, axis=1, keepdims=True)
    assert np.allclose(np.linalg.norm(found.rays(points), axis=1), 1)
    # Camera and place turn against each other by less than the deviations.
    assert max(angle(a, b) for a, b in zip(found.rays(points), truth)) < 1.5


def test_random_arcs_have_no_attitude(caplog):
    caplog.set_level(logging.INFO)
    for count in (20, 60, 200):
        for seed in range(8):
            arcs = arcs_of(clutter(count, np.random.default_rng(seed)))
            assert estimate_attitude(arcs, SHAPE, DivisionModel(0.0, SHAPE)) is None
    assert 'in log likelihood, must be at least' in caplog.text


def test_curved_things_have_no_attitude():
    lens = DivisionModel(0.0, SHAPE)
    assert estimate_attitude(arcs_of(wheels(lens, 60, 0)), SHAPE, lens) is None


def test_few_arcs_have_no_attitude(caplog):
    caplog.set_level(logging.INFO)
    assert estimate_attitude(place(VIEW, 500.0, counts=(3, 3, 3), others=0), SHAPE) is None
    assert estimate_attitude(Arcs.empty(), SHAPE) is None
    assert '9 arcs, must be at least' in caplog.text


@pytest.mark.parametrize('others', [0, 20, 80])
def test_parallel_lines_have_no_focal_length(others):
    for seed in range(6):
        arcs = place(VIEW, 500.0, seed=seed, counts=(0, 60, 0), others=others)
        found = estimate_attitude(arcs, SHAPE, DivisionModel(0.0, SHAPE))
        assert found is None or found.focal is None


def test_a_chessboard_seen_frontally_has_up_at_most():
    board = np.kron(np.indices((8, 11)).sum(axis=0) % 2, np.ones((48, 48))) * 160 + 40
    gray = np.full(SHAPE, 200, np.uint8)
    gray[48:432, 56:584] = board
    gray = cv2.GaussianBlur(gray, (0, 0), 0.7)
    found = estimate_attitude(Detector(Parameters()).detect(gray), SHAPE)
    assert found is None or found.focal is None
    if found is not None and found.up is not None:
        assert angle(found.up, np.array([0, -1.0, 0])) < 5


@pytest.mark.parametrize('lam', [-0.3, -0.6, -0.9])
def test_the_rendered_room(lam):
    scene = Scene(640, 480, lam, 2.0)
    told = []
    for number in (0, 240, 480, 720, 960):
        arcs = Detector().detect(scene.image(number))
        found = estimate_attitude(arcs, SHAPE, estimate_distortion([arcs], SHAPE))
        assert angle(found.up, scene._camera(number).axes[:, 2]) < 0.3
        if found.focal is not None:
            focal = FOCAL * scene.lens.half_diagonal
            told.append(found.focal)
            assert abs(found.focal - focal) < 3 * found.focal_std
    assert told


@pytest.mark.parametrize('arguments, words', [
    ({'focal': 0.0}, 'focal is 0.0: must be above 0 px'),
    ({'focal': float('nan')}, 'focal is nan'),
    ({'lens': DivisionModel(0.0, (240, 320))}, r'lens is that of images of \(240, 320\)'),
    ({'up_hint': (0, 0, 0)}, r'up_hint is \(0, 0, 0\)'),
])
def test_errors_name_the_argument(arguments, words):
    with pytest.raises(ValueError, match=words):
        estimate_attitude(Arcs.empty(), SHAPE, **arguments)


def test_the_slope_is_that_of_the_likelihood():
    """The analytic derivatives agree with differences, for all unknowns."""
    seen = observe(place(VIEW, 500.0, -0.3), DivisionModel(0.0, SHAPE), np.zeros(160)).seen
    state = np.concatenate([turned(0.61, 0.26, 0.04).ravel(), [0.2, -0.29, 0.02, 0.01, -0.02]])
    points, hessian, slope = np.empty((3, 3)), np.empty((UNKNOWNS,) * 2), np.empty(UNKNOWNS)
    _accumulate(seen, state, points, hessian, slope)
    analytic, unused = slope.copy(), np.empty(UNKNOWNS)
    for k in range(UNKNOWNS):
        values = []
        for step in (-1e-6, 1e-6):
            moved = np.empty(STATE)
            _move(state, step * np.eye(UNKNOWNS)[k], moved)
            values.append(_accumulate(seen, moved, points, hessian, unused))
        assert -(values[1] - values[0]) / 2e-6 == pytest.approx(analytic[k], rel=1e-2, abs=0.05)


def test_lines_pass_their_points():
    lens = DivisionModel(-0.4, SHAPE)
    seen = observe(place(VIEW, 500.0, -0.4), lens, np.zeros(160)).seen
    rows = lines(seen, -0.4, 0.0)
    square = (seen[:, :2] ** 2).sum(axis=1)
    q = np.column_stack([seen[:, :2], 1 - 0.4 * square])
    assert np.allclose((rows[:3].T * q).sum(axis=1), 0)
    assert np.allclose((rows[3:6].T * q).sum(axis=1), 0)
