"""The generalised circle against plain geometry, where that still has the digits for it."""
from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core import circle, DivisionModel, paper
from qflsd_ros.core.circle import CurvatureLimits, FIT_SIZE
from qflsd_ros.core.detection.frame import lens_prior
from seen import edge, edges

radii = st.floats(50, 1e7)
angles = st.floats(-np.pi, np.pi)
places = st.tuples(st.floats(-4000, 4000), st.floats(-4000, 4000))
sides = st.sampled_from([-1, 1])
lambdas = st.floats(-1, 0.3)
seeds = st.integers(0, 10**6)
ANY = 1e9       # 1/px, above the curvature of any curve
FIT = {'x': circle.X0, 'y': circle.Y0, 'A': circle.A, 'B': circle.B, 'C': circle.C,
       'D': circle.D, 'rss': circle.RSS, 'n': circle.COUNT, 'var_A': circle.VAR_A,
       'lever_A': circle.LEVER_A, 'lever_D': circle.LEVER_D, 'bent': circle.BENT}
SHAPE = 480, 640


def arc(place: tuple[float, float], angle: float, radius: float, length: float,
        n: int) -> np.ndarray:
    """Return n points of an arc, (n, 2), that has its middle, headed to ``angle``, at a place."""
    turn = np.linspace(-0.5, 0.5, n) * length / radius
    along, across = radius * np.sin(turn), 2 * radius * np.sin(turn / 2) ** 2
    u = np.array([np.cos(angle), np.sin(angle)])
    return np.array(place) + along[:, None] * u + across[:, None] * [-u[1], u[0]]


def through(points: np.ndarray, max_curvature: float = ANY) -> circle.Circle:
    """Return the circle through the rows of (3, 2) points; its origin is the middle one."""
    return circle.normalised(*circle.through(*map(tuple, points), max_curvature))


def fit(points: np.ndarray, weight: np.ndarray | None = None, residual: float = 0.0,
        significance: float = 0.0, maximum: float = ANY,
        lens: DivisionModel | None = None) -> dict[str, float] | None:
    """Return the fit to all points by the names of its columns, or None."""
    fits = np.empty((1, FIT_SIZE))
    rows = np.vstack(points.T if weight is None else [*points.T, weight])
    limits = CurvatureLimits(significance, maximum, lens_prior(lens))
    if not circle.fit(rows, (0, len(points) - 1), residual, limits, fits, 0):
        return None
    return {name: fits[0, column] for name, column in FIT.items()}


def off(fitted: dict[str, float], points: np.ndarray) -> np.ndarray:
    """Return the distances of points from a fit, with P rising towards the y axis."""
    model = tuple(fitted[name] for name in 'ABCD')
    return np.array([circle.distance(model, x - fitted['x'], y - fitted['y'])
                     for x, y in points])


@given(places, angles, radii, sides, st.floats(10, 100))
def test_through_three_points(place, angle, radius, side, length):
    points = arc(place, angle, side * radius, length, 3)
    model = through(points)
    assert np.isclose(2 * abs(model[0]), 1 / radius, rtol=1e-3, atol=1e-9)
    assert np.isclose(model[1] ** 2 + model[2] ** 2 - 4 * model[0] * model[3], 1)
    for x, y in points - points[1]:
        assert abs(circle.distance(model, x, y)) < 1e-6


@given(lambdas, angles, st.floats(-200, 200), st.floats(10, 100), st.floats(0.1, 0.9))
def test_the_image_of_a_line_through_two_points(lam, angle, away, half, share):
    lens = DivisionModel(lam, SHAPE)
    u = np.array([np.cos(angle), np.sin(angle)])
    start, end = (lens.origin + along * u + away * np.array([-u[1], u[0]])
                  for along in (-half, half))
    straight = lens.undistort(np.array([start, end]))
    between = lens.distort(share * straight[0] + (1 - share) * straight[1])
    start, end, between = start - lens.origin, end - lens.origin, between - lens.origin
    model = circle.normalised(*circle.image_of_line(tuple(start), tuple(end), lens.in_pixels[0]))
    assert np.isclose(model[1] ** 2 + model[2] ** 2 - 4 * model[0] * model[3], 1)
    for point in (start, end, between):
        assert abs(circle.distance(model, *point)) < 1e-6


@given(places, angles, radii, st.floats(-30, 30), st.floats(-0.5, 0.5))
def test_distance_from_a_circle(place, angle, radius, away, share):
    model = through(arc(place, angle, radius, 80, 3))
    centre = radius * np.array([-np.sin(angle), np.cos(angle)])
    angle = angle + share * 80 / radius
    point = centre + (radius - away) * np.array([np.sin(angle), -np.cos(angle)])
    sign = np.sign(model[1] * -np.sin(angle) + model[2] * np.cos(angle))
    assert np.isclose(sign * circle.distance(model, *point), away, rtol=0, atol=1e-4)


@given(places, angles, st.floats(5, 100), st.floats(-200, 200), st.floats(-200, 200))
def test_distance_from_a_line(place, angle, length, along, away):
    u = np.array([np.cos(angle), np.sin(angle)])
    normal = np.array([-u[1], u[0]])
    model = through(np.array([place - length * u, place, place + length * u]), 1e-9)
    sign = np.sign(model[1] * normal[0] + model[2] * normal[1])
    d = sign * circle.distance(model, *(along * u + away * normal))
    assert abs(model[0]) < 1e-15
    assert np.isclose(d, away, rtol=0, atol=1e-6)


@given(radii, angles, st.floats(-5, 5))
def test_value_is_the_distance_near_the_curve(radius, angle, away):
    model = through(arc((0, 0), angle, radius, 50, 3))
    x, y = away * model[1], away * model[2]
    value, distance = circle.value(model, x, y), circle.distance(model, x, y)
    assert abs(value - distance) <= 1.001 * abs(model[0]) * away ** 2 + 1e-9


def test_the_centre_is_farthest():
    model = through(arc((0, 0), 0, 50, 100, 3))
    assert np.isclose(abs(circle.distance(model, 0, 50)), 50)


@given(places, angles, st.floats(50, 300), st.floats(10, 60))
def test_above_the_maximum_curvature_is_the_line_through_two(place, angle, radius, length):
    points = arc(place, angle, radius, length, 3)
    model = through(points, 0.9 / radius)
    outer = points[[0, 2]] - points[1]
    assert model[0] == 0 and np.isclose(model[1] ** 2 + model[2] ** 2, 1)
    assert all(abs(circle.distance(model, *point)) < 1e-6 for point in outer)


def test_outer_points_that_coincide_determine_nothing():
    model, square = circle.through((3, 4), (8, 9), (3, 4), ANY)
    assert not circle.value(model, 0, 0) ** 2 < square


@given(places, angles, radii, sides, st.floats(30, 200), st.integers(5, 60))
def test_fit_of_exact_points(place, angle, radius, side, length, n):
    length = min(length, 2 * radius)
    points = arc(place, angle, side * radius, length, n)
    fitted = fit(points)
    assert np.abs(off(fitted, points)).max() < 1e-4
    assert np.isclose(2 * abs(fitted['A']), 1 / radius, rtol=1e-4, atol=1e-8)
    assert fitted['n'] == n and np.isclose(fitted['rss'], 0, atol=1e-6)


def test_fit_is_not_biased_where_that_of_kasa_is():
    random = np.random.default_rng(0)
    ours, variances, kasa = [], [], []
    for _ in range(300):
        points = arc((900, 500), 0.6, 10_000, 200, 200) + random.normal(0, 0.2, (200, 2))
        fitted = fit(points)
        ours.append(2 * abs(fitted['A']) * np.sign(-fitted['A'] * fitted['C']))
        variances.append(4 * fitted['var_A'])
        e, f, g = paper.solve(points)
        kasa.append(1 / np.sqrt((e * e + f * f) / 4 - g))
    error = np.std(ours) / np.sqrt(len(ours))
    assert abs(np.mean(ours) - 1e-4) < 3 * error
    assert error < 1e-6
    # The noise of these points is independent, that of edge points is not.
    assert 0.8 < np.mean(variances) / circle.CORRELATED / np.var(ours) < 1.25
    assert np.mean(kasa) > 1.5e-4


@pytest.mark.parametrize('angle', np.radians(np.arange(0, 360, 15.0)))
@pytest.mark.parametrize('n', [8, 20, 200])
def test_a_straight_row_of_pixels_is_straight(angle, n):
    points = np.round(arc((300, 300), angle, 1e12, n, n + 1))
    fitted = fit(points, significance=3.0, maximum=0.01)
    assert fitted['A'] == 0
    assert np.abs(off(fitted, points)).max() < 1


@given(places, angles, st.floats(100, 1e5), st.lists(st.integers(1, 9), min_size=2, max_size=9),
       st.integers(0, 1000))
def test_weights_are_repetitions(place, angle, radius, half, seed):
    # The same from both ends, so that the middle point is the same one.
    weight = np.array([*half, 5, *reversed(half)])
    points = arc(place, angle, radius, 60, len(weight))
    points = points + np.random.default_rng(seed).normal(0, 0.3, points.shape)
    one, other = fit(points, weight.astype(float)), fit(np.repeat(points, weight, axis=0))
    for name in FIT:
        assert np.isclose(one[name], other[name], rtol=1e-6, atol=1e-9), name


def test_residual_is_added():
    points = arc((0, 0), 0, 500, 60, 30) + np.random.default_rng(0).normal(0, 0.3, (30, 2))
    plain, more = fit(points), fit(points, residual=7.0)
    assert np.isclose(more['rss'], plain['rss'] + 7)
    assert more['var_A'] > plain['var_A'] and more['A'] == plain['A']


def test_residual_sum_of_squares_is_that_of_the_distances():
    points = arc((0, 0), 1, 500, 60, 30) + np.random.default_rng(0).normal(0, 0.3, (30, 2))
    fitted = fit(points)
    assert np.isclose(fitted['rss'], (off(fitted, points) ** 2).sum(), rtol=0.01)


@pytest.mark.parametrize('points', [np.zeros((5, 2)), np.array([[0, 0], [1, 1], [0, 0.0]])])
def test_points_that_determine_nothing(points):
    assert fit(points) is None


def test_two_points_are_a_line():
    fitted = fit(np.array([[0, 0], [30, 40.0]]))
    assert fitted['A'] == 0 and np.allclose(off(fitted, np.array([[3, 4.0], [8, -6]])), [0, -10])


def bend(fitted: dict[str, float]) -> float:
    """Return the curvature of a fit, 1/px, positive where it bends away from its gradient."""
    return 2 * fitted['A']


def wanted(lens: DivisionModel, fitted: dict[str, float]) -> float:
    """Return the same of the image of a line in the place of a fit."""
    model = tuple(fitted[name] for name in 'ABCD')
    gradient = np.array([fitted['B'], fitted['C']])
    point = np.array([fitted['x'], fitted['y']]) - circle.distance(model, 0, 0) * gradient
    return float(lens.curvature(point, gradient / np.hypot(*gradient)))


def noisy(points: np.ndarray, sigma: float, seed: int) -> np.ndarray:
    """Return points that are off by a standard deviation in px."""
    return points + np.random.default_rng(seed).normal(0, sigma, points.shape)


@given(lambdas, st.floats(20, 620), st.floats(20, 460), angles, st.floats(-20, 20),
       st.floats(-20, 20))
def test_at_the_centre_of_a_lens(lam, x, y, angle, right, down):
    # The image of a line through (x, y), given relative to a point beside it.
    lens = DivisionModel(lam, SHAPE)
    normal, away = np.array([np.cos(angle), np.sin(angle)]), np.array([right, down])
    a = lens.curvature(np.array([x, y]), normal) / 2
    b, c = 2 * a * away + normal
    d = a * (away ** 2).sum() + (away * normal).sum()
    lam_px, *centre = lens.in_pixels
    at = np.array(centre) - (x, y) - away
    found = circle.at_centre(lam_px, *at, b, c, d)
    assert np.isclose(lam_px * found, a, rtol=1e-9, atol=1e-15)
    assert np.isclose(found, circle.value((a, b, c, d), *at), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize('centre', [None, (250.0, 300.0)])
@pytest.mark.parametrize('lam', [-0.8, -0.3, 0.2])
@pytest.mark.parametrize('seed', range(4))
def test_a_short_arc_is_bent_as_the_lens_bends_it(lam, centre, seed):
    lens = DivisionModel(lam, SHAPE, centre)
    points = noisy(edge(lens, (420, 60), (455, 85)), 0.2, seed)
    usual = fit(points, significance=9.0)
    fitted = fit(points, significance=9.0, lens=lens)
    assert usual['A'] == 0 and abs(wanted(lens, fitted)) > 1e-4
    assert np.isclose(bend(fitted), wanted(lens, fitted), rtol=0.05)
    assert np.isclose(fitted['rss'], (off(fitted, points) ** 2).sum(), rtol=0.01)
    assert fitted['lever_D'] > 0 and fitted['var_A'] == usual['var_A']
    assert not usual['bent'] and not fitted['bent'] and fit(points)['bent']


@pytest.mark.parametrize('lam', [-0.7, -0.25])
def test_a_known_lens_makes_short_arcs_more_exact(lam):
    lens, random = DivisionModel(lam, SHAPE), np.random.default_rng(0)
    errors = []
    for curve in edges(lens, 200, seed=1, length=(30, 50)):
        points = curve + random.normal(0, 0.2, curve.shape)
        for known in (None, lens):
            fitted = fit(points, significance=2.3, lens=known)
            errors.append(abs(bend(fitted) - wanted(lens, fitted)))
    usual, better = np.median(np.reshape(errors, (-1, 2)), axis=0)
    assert better < 0.1 * usual


@given(places, angles, st.floats(20, 60), sides, seeds, st.floats(-0.3, 0.2))
def test_an_arc_bent_otherwise_stays_as_it_is(place, angle, radius, side, seed, lam):
    lens = DivisionModel(lam, SHAPE, tuple(np.array(place) + (100, 50)))
    points = noisy(arc(place, angle, side * radius, 50, 50), 0.1, seed)
    assert fit(points, significance=3.0, lens=lens) == fit(points)


@given(places, angles, seeds)
def test_without_distortion_a_straight_edge_is_straight(place, angle, seed):
    points = noisy(arc(place, angle, 1e12, 40, 40), 0.2, seed)
    for lens in (None, DivisionModel(0.0, SHAPE)):
        fitted = fit(points, significance=9.0, lens=lens)
        assert fitted['A'] == 0
        assert np.abs(off(fitted, points)).max() < 1.5


def test_above_the_maximum_curvature_is_the_image_of_a_line():
    lens = DivisionModel(-0.3, SHAPE)
    points = arc((500, 100), 0.5, 60, 40, 40)
    fitted = fit(points, maximum=0.9 / 60, lens=lens)
    assert np.isclose(bend(fitted), wanted(lens, fitted), rtol=0.05)
    assert 1e-4 < abs(bend(fitted)) < 0.9 / 60


def test_two_points_are_an_arc_through_a_lens():
    lens = DivisionModel(-0.5, SHAPE)
    whole = edge(lens, (450, 50), (500, 90))
    fitted = fit(whole[[0, -1]], lens=lens)
    chord = fit(whole[[0, -1]])
    assert np.abs(off(chord, whole)).max() > 0.4
    assert np.abs(off(fitted, whole)).max() < 0.05
