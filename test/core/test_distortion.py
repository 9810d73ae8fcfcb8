"""The division model: both ways, and what it makes of a straight line."""
from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from qflsd_ros.core import DivisionModel

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
