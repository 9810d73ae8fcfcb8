"""The division model: both ways, what it makes of a straight line, and arcs made straight."""
from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core import Arcs, DivisionModel, rectified
from seen import arcs_of, edges

lambdas = st.floats(-1.5, 0.24)
shapes = st.tuples(st.integers(10, 3000), st.integers(10, 3000))
shares = st.tuples(st.floats(0, 1), st.floats(0, 1))


def inside(lens: DivisionModel, share: tuple[float, float]) -> np.ndarray:
    """Return a point of the image, within the radius at which the model reaches infinity."""
    height, width = lens.shape
    point = np.array(share) * (width - 1, height - 1) - lens.origin
    if lens.lam < 0:
        point *= min(1, 0.95 * lens.half_diagonal / np.sqrt(-lens.lam)
                     / max(np.hypot(*point), 1e-9))
    return point + lens.origin


@given(lambdas, shapes, shares)
def test_there_and_back(lam, shape, share):
    lens = DivisionModel(lam, shape)
    point = inside(lens, share)
    assert np.allclose(lens.distort(lens.undistort(point)), point, rtol=0, atol=1e-6)


@given(lambdas, shapes, shares)
def test_back_and_there(lam, shape, share):
    lens = DivisionModel(lam, shape)
    point = inside(lens, share)
    assert np.allclose(lens.undistort(lens.distort(point)), point, rtol=0, atol=1e-6)


@given(shapes, shares)
def test_without_distortion_nothing_moves(shape, share):
    lens = DivisionModel(0.0, shape)
    point = inside(lens, share)
    assert np.allclose(lens.distort(point), point) and np.allclose(lens.undistort(point), point)


def test_centre():
    assert DivisionModel(-0.5, (3, 5)).origin.tolist() == [2, 1]
    lens = DivisionModel(-0.5, (30, 50), centre=(7.0, 8.0))
    assert lens.origin.tolist() == [7, 8]
    assert lens.distort(lens.origin).tolist() == lens.undistort(lens.origin).tolist() == [7, 8]


@given(lambdas, shapes, shares, st.integers(1, 5))
def test_the_lens_of_a_smaller_image_does_the_same(lam, shape, share, factor):
    lens = DivisionModel(lam, shape, (0.4 * shape[1], 0.6 * shape[0]))
    small = lens.reduced(factor)
    assert small.shape == (shape[0] // factor, shape[1] // factor)
    point = inside(lens, share)
    there = small.undistort((point - (factor - 1) / 2) / factor) * factor + (factor - 1) / 2
    assert np.allclose(there, lens.undistort(point), rtol=1e-6, atol=1e-6)


def test_the_lens_of_a_smaller_image_keeps_lambda_and_the_middle():
    small = DivisionModel(-0.4, (480, 640)).reduced(2)
    whole = DivisionModel(-0.4, (240, 320))
    assert small.lam == pytest.approx(-0.4, rel=1e-12) and small.shape == whole.shape
    assert small.origin.tolist() == whole.origin.tolist()


def test_lambda_is_normalised_to_half_the_diagonal():
    lens = DivisionModel(-0.5, (600, 800), centre=(0.0, 0.0))
    assert lens.half_diagonal == 500
    assert np.allclose(lens.undistort([500.0, 0.0]), [1000, 0])
    assert np.allclose(lens.undistort([[300.0, 400.0], [0.0, 0.0]]), [[600, 800], [0, 0]])


def test_where_a_lens_shows_nothing():
    lens = DivisionModel(0.25, (600, 800), centre=(0.0, 0.0))
    assert np.allclose(lens.distort([500.0, 0.0]), [1000, 0])
    assert np.isnan(lens.distort([501.0, 0.0])).all()


@given(st.floats(-1.2, -0.05), st.floats(0, 2 * np.pi), st.floats(20, 600))
def test_a_line_is_seen_as_a_circle_that_tells_lambda(lam, angle, far):
    lens = DivisionModel(lam, (600, 800))
    normal = np.array([np.cos(angle), np.sin(angle)])
    along = np.linspace(-900, 900, 30)[:, None] * [-normal[1], normal[0]]
    seen = (lens.distort(lens.origin + far * normal + along) - lens.origin) / lens.half_diagonal
    design = np.column_stack([seen, np.ones(len(seen))])
    (e, f, g), *_ = np.linalg.lstsq(design, -(seen ** 2).sum(axis=1), rcond=None)
    assert np.abs((seen ** 2).sum(axis=1) + design @ (e, f, g)).max() < 1e-9
    assert np.isclose(1 / g, lam, rtol=1e-6)


@given(lambdas, shapes, shares)
def test_beyond_infinity_there_is_nothing(lam, shape, share):
    lens = DivisionModel(lam, shape)
    point = np.array(share) * (shape[1] - 1, shape[0] - 1)
    shown = np.abs(lam) * np.square((point - lens.origin) / lens.half_diagonal).sum() < 1
    assert np.isfinite(lens.undistort(point)).all() == shown


@given(lambdas, st.floats(0, 2 * np.pi), st.floats(5, 200))
def test_curvature_of_the_picture_of_an_edge(lam, angle, far):
    lens = DivisionModel(lam, (600, 800), centre=(390.0, 310.0))
    normal = np.array([np.cos(angle), np.sin(angle)])
    along = np.array([-40.0, 0.0, 40.0])[:, None] * [-normal[1], normal[0]]
    a, b, c = lens.distort(lens.origin + far * normal + along)
    # The circle through three points; the tangent at the middle one is along the edge.
    area = (b - a)[0] * (c - b)[1] - (b - a)[1] * (c - b)[0]
    sides = np.hypot(*(b - a)) * np.hypot(*(c - b)) * np.hypot(*(c - a))
    towards = np.sign((b - (a + c) / 2) @ normal)
    assert lens.curvature(b, normal) == pytest.approx(towards * 2 * abs(area) / sides, abs=1e-9)


@given(st.floats(-0.9, 0.2), st.integers(0, 10**6))
def test_rectified_arcs_are_where_the_edges_are(lam, seed):
    lens = DivisionModel(lam, (480, 640), centre=(330.0, 230.0))
    curves = edges(lens, 10, seed)
    segments = rectified(arcs_of(curves, 0.0), lens)
    assert segments.shape == (10, 2, 2)
    for segment, curve in zip(segments, curves):
        assert segment == pytest.approx(lens.undistort(curve[[0, -1]]), abs=1e-6)


def test_an_arc_that_is_not_quite_straight_is_rectified_to_the_line_nearest_to_it():
    lens = DivisionModel(0.0, (480, 640))
    turn = np.linspace(-0.05, 0.05, 101)
    bow = np.array([320.0, 1240.0]) + 1000 * np.stack([np.sin(turn), -np.cos(turn)], 1)
    (start, end), = rectified(arcs_of([bow], 0.0), lens)
    assert [start[0], end[0]] == pytest.approx(bow[[0, -1], 0], abs=1e-6)
    assert start[1] == pytest.approx(end[1]) and bow[50, 1] < start[1] < bow[0, 1]


def test_what_an_undistorted_image_cannot_show_is_not_rectified():
    lens = DivisionModel(-2.0, (480, 640))
    corner, inside = ((10.0, 10), (60, 20)), ((300.0, 100), (400, 90))
    arcs = arcs_of([np.linspace(*ends, 60) for ends in (corner, inside)])
    assert np.isfinite(rectified(arcs, lens)).all(axis=(1, 2)).tolist() == [False, True]
    assert rectified(Arcs.empty(), lens).shape == (0, 2, 2)
