"""The detector as its users see it: what it takes, and what holds for everything it gives."""
from __future__ import annotations

import functools
from typing import Callable

import cv2
from finding import find, project, samples
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from qflsd_ros.core import Arcs, Detector, DivisionModel, Parameters
from rendering import disk, half_plane, polygon, render, through_lens

SIZES = [(1, 1), (1, 9), (9, 1), (2, 2), (2, 50), (3, 3), (3, 4), (5, 5), (7, 1000), (1000, 7),
         (8, 8), (64, 65)]


@functools.cache
def scene(seed: int = 0, shape: tuple[int, int] = (180, 240)) -> np.ndarray:
    """Return an image of straight edges behind a lens, a round edge, and noise."""
    random = np.random.default_rng(seed)
    height, width = shape
    lens = DivisionModel(-0.4, shape)
    gray = render(shape, disk(0.4 * width, 2.1 * height, 1.4 * height), 90, 150).astype(float)
    for _ in range(4):
        x, y = random.uniform(0.1, 0.7, 2) * (width, height)
        w, h = random.uniform(0.2, 0.5, 2) * (width, height)
        angle, level = random.uniform(0, 0.6), random.uniform(-60, 60)
        u, v = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        corners = [tuple(np.array([x, y]) + p) for p in (0 * u, w * u, w * u + h * v, h * v)]
        gray += render(shape, through_lens(polygon(corners), lens), 0, 100) / 100 * level
    gray = np.clip(np.round(gray + random.normal(0, 2, shape)), 0, 255).astype(np.uint8)
    gray.flags.writeable = False
    return gray


def noise(seed: int, shape: tuple[int, int]) -> np.ndarray:
    """Return noise of every grain, from single pixels to areas."""
    random = np.random.default_rng(seed)
    gray = random.normal(0, 1, shape)
    for grain in (2.0, 5.0, 12.0):
        gray += 2 * grain * cv2.GaussianBlur(random.normal(0, 1, shape), (0, 0), grain)
    return np.clip(128 + 40 * gray, 0, 255).astype(np.uint8)


def assert_same(one: Arcs, other: Arcs) -> None:
    """Assert that two results are the same, bit for bit."""
    for name in ('table', 'edge_points', 'edge_pixels', 'offsets'):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


def assert_sound(arcs: Arcs, gray: np.ndarray, parameters: Parameters = Parameters()) -> None:
    """Assert what holds for every arc of every image."""
    height, width = gray.shape
    table = arcs.table
    for name in table.dtype.names:
        assert np.isfinite(table[name]).all(), name
    for name in ('start', 'middle', 'end'):
        assert (table[name] >= -0.5).all(), name
        assert (table[name] <= (width - 0.5, height - 0.5)).all(), name
    assert (table['length'] >= parameters.min_length).all()
    assert (table['rms'] <= parameters.tolerance).all()
    assert (table['score'] >= parameters.min_score).all()
    assert (table['contrast'] > 0).all()
    assert ((table['polarity'] >= 0) & (table['polarity'] <= 1)).all()
    assert (table['curvature_std'] > 0).all() and (table['offset_std'] > 0).all()
    assert table['support'].tolist() == [len(arcs.pixels(i)) for i in range(len(arcs))]
    assert arcs.offsets[0] == 0 and arcs.offsets[-1] == len(arcs.edge_pixels)
    assert len({tuple(pixel) for pixel in arcs.edge_pixels}) == len(arcs.edge_pixels)
    assert np.abs(arcs.edge_points - arcs.edge_pixels).max(initial=0) <= 1
    for i in range(len(arcs)):
        assert_one_circle(table[i])
        assert_along(samples(arcs, i), arcs.points(i), parameters)


def assert_one_circle(row: np.void) -> None:
    """Assert that start, middle, end, curvature and length tell of the same arc."""
    a, b, c = row['middle'] - row['start'], row['end'] - row['middle'], row['end'] - row['start']
    sizes = np.hypot(*np.array([a, b, c]).T)
    assert np.isclose(sizes[0], sizes[1], rtol=0, atol=1e-6)
    curvature = 2 * (a[0] * b[1] - a[1] * b[0]) / sizes.prod()
    assert np.isclose(row['curvature'], curvature, rtol=1e-6, atol=1e-9)
    half = row['curvature'] * row['length'] / 2
    assert abs(half) <= np.pi / 2 + 1e-6
    assert np.isclose(sizes[2], row['length'] * np.sinc(half / np.pi), rtol=1e-6)


def assert_along(line: np.ndarray, points: np.ndarray, parameters: Parameters) -> None:
    """Assert that edge points lie along an arc in order, from its start to its end."""
    off, place = project(points, line)
    assert off.max() < 2.5 * parameters.tolerance
    assert np.diff(place).min(initial=0) > -6
    assert place[0] < 4 and place[-1] > project(line[-1:], line)[1] - 4


@pytest.mark.parametrize('gray', [
    np.zeros((4, 4)), np.zeros((4, 4), np.int8), np.zeros((4, 4), np.uint16),
    np.zeros((4, 4), bool), [[0, 1], [2, 3]], None, 'image.png', b'1234', np.uint8(3)])
def test_what_is_no_uint8_array(gray):
    came = str(gray.dtype) if isinstance(gray, np.ndarray) else type(gray).__name__
    with pytest.raises(TypeError, match='must be a uint8 array') as caught:
        Detector().detect(gray)
    assert came in str(caught.value)


@pytest.mark.parametrize('shape', [(), (9,), (9, 9, 1), (9, 9, 3), (0, 9), (9, 0), (0, 0)])
def test_wrong_shape(shape):
    with pytest.raises(ValueError, match='must be .height, width.') as caught:
        Detector().detect(np.zeros(shape, np.uint8))
    assert str(shape) in str(caught.value)


@pytest.mark.parametrize('method', ['arcs', 'paper'])
@pytest.mark.parametrize('shape', SIZES)
def test_any_size(shape, method):
    for gray in (np.zeros(shape, np.uint8), noise(0, shape),
                 np.random.default_rng(0).integers(0, 256, shape, np.uint8)):
        arcs = Detector(Parameters(method=method, paper_max_hypotheses=20)).detect(gray)
        if method == 'arcs':
            assert_sound(arcs, gray)
        else:
            assert np.isfinite(arcs.edge_points).all()


@pytest.mark.parametrize(('shape', 'across'), [((7, 1000), 1000), ((40, 3000), 3000)])
def test_a_narrow_image(shape, across):
    gray = np.full(shape, 60, np.uint8)
    gray[shape[0] // 2:] = 180
    for image in (gray, np.ascontiguousarray(gray.T)):
        row, = find(image).table
        assert row['length'] > across - 5


@pytest.mark.parametrize('view', [
    lambda gray: np.asfortranarray(gray), lambda gray: gray[::-1][::-1], lambda gray: gray.T.T,
    lambda gray: np.repeat(gray, 2, axis=1)[:, ::2], lambda gray: gray[:, ::-1].copy()[:, ::-1],
    lambda gray: np.pad(gray, 5)[5:-5, 5:-5], lambda gray: np.stack([gray] * 3, 2)[..., 1],
    lambda gray: np.frombuffer(gray.tobytes(), np.uint8).reshape(gray.shape)])
def test_strides_do_not_matter(view):
    gray = scene()
    assert_same(find(view(gray)), find(gray))


def test_same_bits_again_whatever_came_before():
    detector, gray = Detector(), scene(1)
    first = detector.detect(gray)
    assert len(first) > 3
    for other in (scene(2), noise(0, (300, 50)), scene(3, (90, 400)), np.zeros((2, 2), np.uint8)):
        detector.detect(other)
        assert_same(detector.detect(gray), first)
    assert_same(Detector().detect(gray), first)


def test_a_result_is_not_touched_by_the_next_frame():
    detector, gray = Detector(), scene(1)
    first = detector.detect(gray)
    before = [first.table.tobytes(), first.edge_points.tobytes(), first.edge_pixels.tobytes()]
    detector.detect(scene(2))
    detector.detect(255 - gray)
    assert before == [first.table.tobytes(), first.edge_points.tobytes(),
                      first.edge_pixels.tobytes()]


def test_the_image_is_left_as_it_was():
    gray = scene().copy()
    find(gray)
    assert np.array_equal(gray, scene())


def test_parameters_may_be_replaced_between_frames():
    detector, gray = Detector(), scene(1)
    detector.detect(gray)
    detector.parameters = Parameters(min_length=60.0)
    assert_same(detector.detect(gray), find(gray, min_length=60.0))


def test_warm_up_changes_nothing():
    detector, gray = Detector(), scene(1)
    detector.warm_up()
    assert_same(detector.detect(gray), find(gray))


@pytest.mark.parametrize('seed', range(6))
def test_scenes_are_sound(seed):
    gray = scene(seed)
    arcs = find(gray)
    assert len(arcs) > 3
    assert_sound(arcs, gray)


@given(st.integers(0, 10**6), st.tuples(st.integers(3, 120), st.integers(3, 160)))
def test_noise_is_sound(seed, shape):
    gray = noise(seed, shape)
    assert_sound(find(gray), gray)


@given(st.integers(0, 10**6), st.floats(0.3, 3), st.floats(3, 40), st.sampled_from([0, 10, 200]),
       st.floats(0.02, 2), st.sampled_from([0.0, 2.2, 10.0]))
def test_any_parameters_are_sound(seed, tolerance, min_length, max_gap, min_radius, min_distance):
    parameters = Parameters(tolerance=tolerance, min_length=min_length, max_gap=max_gap,
                            min_radius=min_radius, min_distance=min_distance, contrast_low=2.0)
    gray = noise(seed, (90, 120))
    assert_sound(Detector(parameters).detect(gray), gray, parameters)


@settings(max_examples=15)
@given(arrays(np.uint8, st.tuples(st.integers(1, 40), st.integers(1, 40))))
def test_any_image_is_sound(gray):
    parameters = Parameters(min_length=3.0, min_score=-1000.0, contrast_low=0.5,
                            contrast_high=1.0)
    for image in (gray, np.kron(gray[:12, :12], np.ones((7, 7), np.uint8))):
        assert_sound(Detector(parameters).detect(image), image, parameters)


@pytest.mark.parametrize('gray', [
    255 * (np.indices((120, 160)).sum(axis=0) % 2).astype(np.uint8),
    255 * (np.indices((120, 160))[1] % 2).astype(np.uint8),
    255 * (np.indices((120, 160)).sum(axis=0) // 2 % 2).astype(np.uint8),
    255 * (np.indices((120, 160))[0] // 3 % 2).astype(np.uint8),
    np.uint8(128 + 120 * np.cos(0.02 * ((np.indices((160, 160)) - 79.5) ** 2).sum(axis=0))),
    np.where(np.hypot(*(np.indices((160, 160)) - 79.5)) // 5 % 2 == 0, 30, 220).astype(np.uint8),
    np.where((np.arctan2(*(np.indices((160, 160)) - 79.5)) * 8 / np.pi) // 1 % 2 == 0, 30,
             220).astype(np.uint8),
], ids=['pixels', 'columns', 'diagonals', 'stripes', 'zones', 'rings', 'star'])
def test_unkind_patterns_are_sound(gray):
    assert_sound(find(gray), gray)
    parameters = Parameters(blur_sigma=0.0, contrast_high=1.0, contrast_low=0.5)
    assert_sound(Detector(parameters).detect(gray), gray, parameters)


def transposed(points: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    return points[..., ::-1]


def mirrored(points: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    return np.stack([shape[1] - 1 - points[..., 0], points[..., 1]], axis=-1)


def upended(points: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    return np.stack([points[..., 0], shape[0] - 1 - points[..., 1]], axis=-1)


def turned(points: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    return np.stack([points[..., 1], shape[1] - 1 - points[..., 0]], axis=-1)


def unmoved(points: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    return points


def agreement(one: Arcs, other: Arcs, move: Callable, shape: tuple[int, int]) -> float:
    """
    Return the share of one result, by length, that is in the other: within 0.05 px across.

    Along the arc, where an edge fades or turns away, its ends may differ by 3 px.
    """
    lines = [samples(other, i) for i in range(len(other))]
    sizes = other.table['length']
    same = np.zeros(len(one), bool)
    for i, length in enumerate(one.table['length']):
        moved = move(samples(one, i), shape)[5:-5]
        same[i] = any(abs(size - length) < 6 and project(moved, line)[0].max() < 0.05
                      for line, size in zip(lines, sizes))
    return one.table['length'][same].sum() / one.table['length'].sum()


TRANSFORMS = [
    (np.transpose, transposed), (lambda gray: gray[:, ::-1], mirrored),
    (lambda gray: gray[::-1], upended), (np.rot90, turned), (lambda gray: 255 - gray, unmoved)]


@pytest.mark.parametrize(('change', 'move'), TRANSFORMS, ids=[
    'transposed', 'mirrored', 'upended', 'turned', 'inverted'])
def test_clean_edges_move_with_the_image(change, move):
    lens = DivisionModel(-0.5, (240, 320))
    corners = [(70, 45), (290, 60), (262, 205), (55, 187)]
    gray = render(lens.shape, through_lens(polygon(corners), lens), blur=0.7)
    one, other = find(gray), find(change(gray))
    assert len(one) == len(other) == 4
    assert agreement(one, other, move, gray.shape) == 1


@pytest.mark.parametrize(('change', 'move'), TRANSFORMS, ids=[
    'transposed', 'mirrored', 'upended', 'turned', 'inverted'])
def test_scenes_move_with_the_image(change, move):
    # Not all: pixels are visited row by row, so that where edges touch another one may go on, and
    # of two equal neighbours across an edge the first is its place.
    shares = []
    for seed in range(6):
        gray = scene(seed)
        one, other = find(gray), find(change(gray))
        shares.append(agreement(one, other, move, gray.shape))
    assert np.mean(shares) > 0.8


@pytest.mark.parametrize(('x', 'y'), [(0, 16), (7, 3), (1, 0)])
def test_arcs_move_with_their_place_in_the_image(x, y):
    gray = render((150, 180), polygon([(30, 30), (150, 40), (140, 110), (35, 100)]))
    moved = np.pad(gray, ((y, 0), (x, 0)), mode='edge')
    one, other = find(gray), find(moved)
    assert len(one) == len(other) == 4
    assert agreement(one, other, lambda points, shape: points + (x, y), gray.shape) == 1


@pytest.mark.parametrize('gain', [0.5, 1.5])
def test_gain_changes_contrast_alone(gain):
    edge = half_plane(79.5, 59.5, 0.4)
    one, other = (find(render((120, 160), edge, 40 * g, 120 * g)) for g in (1, gain))
    assert len(one) == len(other) == 1
    assert agreement(one, other, unmoved, (120, 160)) == 1
    assert np.isclose(other.table['contrast'], gain * one.table['contrast'], rtol=0.02)
