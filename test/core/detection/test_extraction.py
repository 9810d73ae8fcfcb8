"""Arcs whose circles are known, found whole and where they are."""
from __future__ import annotations

from finding import chord_angle, find, only, samples
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core import DivisionModel
from rendering import disk, half_plane, off_circle, off_line, polygon, render, through_lens

SHAPE = (200, 240)
MIDDLE = (119.5, 99.5)
angles = st.floats(-np.pi, np.pi)
noises = st.sampled_from([0.0, 3.0, 8.0])


def circle(radius: float, angle: float, offset: float) -> tuple[float, float, float]:
    """Return a circle whose edge passes the middle of the image at ``offset`` px."""
    return (MIDDLE[0] + (radius + offset) * np.cos(angle),
            MIDDLE[1] + (radius + offset) * np.sin(angle), radius)


def inside(shape: tuple[int, int], points: np.ndarray, margin: float) -> np.ndarray:
    """Return those of (n, 2) points that are at least ``margin`` px inside of an image."""
    size = np.array(shape)[::-1]
    return points[((points >= margin) & (points <= size - 1 - margin)).all(axis=1)]


@given(st.floats(2.2, 4), angles, st.floats(-20, 20), noises, st.integers(0, 99))
def test_an_arc_is_found_whole_and_in_place(magnitude, angle, offset, noise, seed):
    x, y, radius = circle(10 ** magnitude, angle, offset)
    arcs = find(render(SHAPE, disk(x, y, radius), noise=noise, seed=seed))
    row = only(arcs)
    points = samples(arcs, 0)
    assert np.abs(off_circle(points, x, y, radius)).max() < 0.3
    assert np.isclose(row['curvature'], 1 / radius, rtol=0.02, atol=1e-5)
    turn = angle + np.pi + np.linspace(-1, 1, 10_000) * min(np.pi, 300 / radius)
    truth = inside(SHAPE, np.c_[x + radius * np.cos(turn), y + radius * np.sin(turn)], 0.5)
    assert np.isclose(row['length'], len(truth) * radius * (turn[1] - turn[0]), rtol=0, atol=8)
    assert row['rms'] < 0.2


def test_curvature_and_offset_within_their_stated_deviations():
    random = np.random.default_rng(0)
    scores = []
    for seed in range(40):
        x, y, radius = circle(10 ** random.uniform(2.2, 3.7), random.uniform(-np.pi, np.pi),
                              random.uniform(-20, 20))
        row = only(find(render(SHAPE, disk(x, y, radius), noise=3 * (seed % 2), seed=seed)))
        scores.append(((row['curvature'] - 1 / radius) / row['curvature_std'],
                       off_circle(row['middle'], x, y, radius) / row['offset_std']))
    assert np.abs(scores).max() < 5
    assert 0.1 < np.std(scores) < 2


@given(angles, st.floats(-30, 30), noises, st.integers(0, 99))
def test_a_straight_edge_is_two_points(angle, offset, noise, seed):
    x, y, _ = circle(1e-9, angle + np.pi / 2, offset)
    arcs = find(render(SHAPE, half_plane(x, y, angle), noise=noise, seed=seed))
    row = only(arcs)
    polyline, = arcs.polylines()
    assert polyline.shape == (2, 2)
    assert np.abs(off_line(polyline, x, y, angle)).max() < 0.2
    assert abs(row['curvature']) <= 4 * row['curvature_std']
    assert row['rms'] < 0.15


@given(angles)
def test_a_straight_edge_without_noise_has_no_curvature(angle):
    assert only(find(render(SHAPE, half_plane(*MIDDLE, angle))))['curvature'] == 0


@given(st.floats(0.6, 2.5), angles)
def test_a_corner_is_two_arcs(opening, angle):
    sides = (half_plane(*MIDDLE, angle), half_plane(*MIDDLE, angle + opening))
    arcs = find(render(SHAPE, lambda u, v: np.minimum(*(side(u, v) for side in sides))))
    assert len(arcs) == 2
    for i in range(2):
        points = samples(arcs, i)
        off = min(np.abs(off_line(points, *MIDDLE, a)).max() for a in (angle, angle + opening))
        assert off < 0.5
        ends = arcs.table[i][['start', 'end']].tolist()
        assert min(np.hypot(*(np.array(end) - MIDDLE)) for end in ends) < 8


@pytest.mark.parametrize('lam', [0.1, 0.0, -0.2, -0.6, -0.9])
def test_straight_edges_through_a_lens(lam):
    lens = DivisionModel(lam, (240, 320))
    corners = [(70, 45), (290, 55), (270, 200), (55, 190)]
    arcs = find(render(lens.shape, through_lens(polygon(corners), lens)))
    assert len(arcs) == 4
    for start, end in zip(corners, [*corners[1:], corners[0]]):
        angle = np.arctan2(end[1] - start[1], end[0] - start[0])
        best = min(range(4), key=lambda i: abs(off_line(
            lens.undistort(arcs.table['middle'][i]), *start, angle)))
        points = lens.undistort(samples(arcs, best))
        assert np.abs(off_line(points, *start, angle)).max() < 0.4
        size = np.hypot(end[0] - start[0], end[1] - start[1])
        assert np.hypot(*(points[-1] - points[0])) > size - 12
        # Travel with the bright inside to the right is along the corners' order.
        assert abs(chord_angle(points[0], points[-1]) - angle) % (2 * np.pi) < 0.1


@pytest.mark.parametrize('lam', [-0.3, -0.8])
def test_each_arc_tells_lambda(lam):
    lens = DivisionModel(lam, (480, 640))
    corners = [(60, 70), (570, 30), (600, 430), (90, 400)]
    arcs = find(render(lens.shape, through_lens(polygon(corners), lens)))
    told = []
    for row in arcs.table:
        a, b, c = (lens.origin - row[name] for name in ('start', 'middle', 'end'))
        # e, f, g of equation (5) with the origin at the centre, of which g is 1 / lambda.
        points = -np.array([a, b, c]) / lens.half_diagonal
        _, _, g = np.linalg.solve(np.c_[points, np.ones(3)], -(points ** 2).sum(axis=1))
        told.append(1 / g)
    assert len(told) == 4 and np.allclose(told, lam, rtol=0.02)


@pytest.mark.parametrize('radius', [70, 80, 100])
def test_a_whole_circle_is_arcs_of_half_a_turn_at_most(radius):
    # The picture of a straight edge never turns by more, and start, middle, end tell no more.
    arcs = find(render((240, 320), disk(160.3, 120.7, radius)), image_circle='off')
    assert arcs.table['length'].sum() > 0.7 * 2 * np.pi * radius
    for i, row in enumerate(arcs.table):
        assert abs(row['curvature'] * row['length']) <= np.pi + 1e-6
        assert np.abs(off_circle(samples(arcs, i), 160.3, 120.7, radius)).max() < 0.5
        assert 0.6 < row['support'] / row['length'] < 1.1


@pytest.mark.parametrize('radius', [20, 40])
def test_what_is_bent_more_than_any_straight_edge_is_no_arc(radius):
    gray = render((240, 320), disk(160.3, 120.7, radius))
    for row in find(gray, min_radius=0.3).table:
        assert row['length'] < 30
        assert abs(row['curvature']) <= 1 / (0.3 * 200)
    assert find(gray, min_radius=0.05).table['length'].max(initial=0) > 2 * radius


@pytest.mark.parametrize('min_length', [15, 40, 120])
def test_shorter_than_min_length_is_not_reported(min_length):
    gray = render(SHAPE, polygon([(30, 30), (200, 30), (200, 55), (30, 55)]))
    lengths = find(gray, min_length=min_length).table['length']
    assert (lengths >= min_length).all()
    assert len(lengths) == (4 if min_length < 25 else 2)


def test_tolerance():
    # Two straight edges that meet at 3 degrees: one arc or two.
    kink = [half_plane(*MIDDLE, 0.3), half_plane(*MIDDLE, 0.3 + np.radians(5))]
    gray = render(SHAPE, lambda u, v: np.minimum(*(side(u, v) for side in kink)))
    assert len(find(gray, tolerance=0.3, max_gap=0)) > len(find(gray, tolerance=3.0, max_gap=0))


@pytest.mark.parametrize(('step', 'found'), [(3, 0), (10, 0), (20, 1), (120, 1)])
def test_contrast_high(step, found):
    gray = render(SHAPE, half_plane(*MIDDLE, np.pi / 2), 100, 100 + step)
    gray[-40:] = 0      # so that the image is one of usual contrast
    arcs = find(gray, contrast_low=5.0, contrast_high=15.0)
    upright = abs(arcs.table['start'][:, 0] - arcs.table['end'][:, 0]) < 2
    assert np.count_nonzero(upright) == found
    assert np.allclose(arcs.table['contrast'][upright], step, rtol=0.3)


@pytest.mark.parametrize(('step', 'found'), [(3, 0), (10, 1)])
def test_contrast_high_is_less_where_there_is_nothing_stronger(step, found):
    gray = render(SHAPE, half_plane(*MIDDLE, 0.4), 100, 100 + step)
    assert len(find(gray, contrast_low=5.0, contrast_high=15.0)) == found


def test_an_edge_that_fades_is_followed_down_to_contrast_low():
    x = np.linspace(0, 1, 240)
    gray = np.full((100, 240), 100, np.uint8)
    gray[50:] = np.round(100 + 30 * (1 - x))
    gray[90:] = 0       # so that the image is one of usual contrast
    lengths = [min(find(gray, contrast_low=low, contrast_high=20.0).table['length'])
               for low in (4.0, 10.0, 18.0)]
    assert lengths[0] > lengths[1] + 30 > lengths[2] + 60
