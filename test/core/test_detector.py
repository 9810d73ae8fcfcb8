"""The detector as its users see it: what it takes, and what holds for everything it gives."""
from __future__ import annotations

from finding import find
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from qflsd_ros.core import Arcs, Detector, DivisionModel, Parameters
from qflsd_ros.sources import Scene
from rendering import polygon, render
from scenery import noise, scene
from soundness import assert_sound

SIZES = [(1, 1), (1, 9), (9, 1), (2, 2), (2, 50), (3, 3), (3, 4), (5, 5), (7, 1000), (1000, 7),
         (8, 8), (64, 65)]


def assert_same(one: Arcs, other: Arcs) -> None:
    """Assert that two results are the same, bit for bit."""
    for name in ('table', 'edge_points', 'edge_pixels', 'offsets'):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


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


def test_an_image_too_large_for_the_numbers_of_its_pixels():
    with pytest.raises(ValueError, match='2500000000 pixels: must be below 2147483648'):
        Detector().detect(np.broadcast_to(np.uint8(0), (50000, 50000)))


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


@given(st.integers(0, 10**6), st.floats(0.1, 10), st.floats(3, 40), st.sampled_from([0, 10, 200]),
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


def longer(arcs: Arcs, least: float) -> Arcs:
    """Return the arcs of at least a length, px."""
    rows = np.flatnonzero(arcs.table['length'] >= least)
    parts = [slice(arcs.offsets[i], arcs.offsets[i + 1]) for i in rows]
    points, pixels = (np.concatenate([all_of[:0], *(all_of[part] for part in parts)])
                      for all_of in (arcs.edge_points, arcs.edge_pixels))
    return Arcs(arcs.table[rows], points, pixels,
                np.cumsum([0, *(part.stop - part.start for part in parts)]))


@given(st.integers(0, 10**6), st.lists(st.floats(3, 120), min_size=2, max_size=4),
       st.sampled_from([None, -0.4]), st.sampled_from([0.0, 2.4, 10.0]))
def test_min_length_leaves_out_what_is_shorter_and_changes_nothing_else(
        seed, lengths, lam, min_distance):
    for gray in (scene(seed % 50), noise(seed, (150, 200))):
        lens = None if lam is None else DivisionModel(lam, gray.shape)
        least, *others = sorted(lengths)
        arcs = find(gray, lens, min_length=least, min_distance=min_distance)
        exact = np.append(others, arcs.table['length'][:3])
        for other in exact[exact >= least]:
            assert_same(find(gray, lens, min_length=other, min_distance=min_distance),
                        longer(arcs, other))


@pytest.mark.parametrize(('side', 'min_length'), [(18, 15), (20, 15), (17, 13)])
def test_sides_a_little_longer_than_min_length_are_found(side, min_length):
    found = []
    for seed in range(40):
        angle = np.random.default_rng(seed).uniform(0, np.pi / 2)
        corners = square(59.7, 49.6, side, angle)
        table = find(render((100, 120), polygon(corners), blur=0.6, noise=2, seed=seed),
                     min_length=min_length).table
        middles = np.array([np.add(a, b) / 2 for a, b in zip(corners, corners[1:] + corners[:1])])
        found += [np.hypot(*(table['middle'] - middle).T).min(initial=99) < 2
                  for middle in middles]
    assert np.mean(found) > 0.9


def square(x: float, y: float, side: float, angle: float) -> list[tuple[float, float]]:
    turns = np.radians([0, 90, 180, 270]) + angle
    return [(x + side / np.sqrt(2) * np.cos(t), y + side / np.sqrt(2) * np.sin(t)) for t in turns]


@given(st.integers(0, 10**6), st.sampled_from([None, -30.0, -6.0, -1.5, -0.4, 0.8, 5.0]),
       st.floats(0.1, 1.5), st.floats(0.3, 3), st.floats(-1, 2))
def test_no_arc_is_bent_more_or_wider_of_its_points_than_it_may_be(
        seed, lam, min_radius, tolerance, place):
    for gray in (scene(seed % 50), noise(seed, (150, 200))):
        height, width = gray.shape
        lens = None if lam is None else DivisionModel(
            lam, gray.shape, (place * width, place * height))
        arcs = find(gray, lens, min_radius=min_radius, tolerance=tolerance, min_score=-1000.0)
        most = 2 / (min_radius * np.hypot(height, width))
        assert np.abs(arcs.table['curvature']).max(initial=0) <= most * (1 + 1e-12)
        assert (arcs.table['rms'] <= tolerance).all()
        for i, row in enumerate(arcs.table):
            assert rms(arcs.points(i), row) < 1.05 * tolerance + 0.01


def rms(points: np.ndarray, row: np.void) -> float:
    """Return the rms distance of points from the circle of an arc, px."""
    chord = row['end'] - row['start']
    left = np.array([-chord[1], chord[0]]) / np.hypot(*chord)
    x, y = np.array([chord / np.hypot(*chord), left]) @ (points - row['middle']).T
    bend = row['curvature'] / 2
    p = bend * (x * x + y * y) - y
    return float(np.sqrt(np.mean((2 * p / (1 + np.sqrt(np.maximum(1 + 4 * bend * p, 0)))) ** 2)))


def test_the_published_method_has_no_mask():
    gray = np.zeros((20, 30), np.uint8)
    with pytest.raises(ValueError, match='mask'):
        Detector(Parameters(method='paper')).detect(gray, gray + 1)


@pytest.mark.parametrize('shape', [(30, 20), (20, 31), (480, 640)])
def test_a_lens_of_other_images(shape):
    with pytest.raises(ValueError, match='lens is for images of shape') as caught:
        Detector().detect(np.zeros((20, 30), np.uint8), lens=DivisionModel(-0.2, shape))
    assert str(shape) in str(caught.value) and '(20, 30)' in str(caught.value)


def test_the_published_method_makes_no_use_of_a_lens():
    gray = scene()[:90, :120]
    parameters = {'method': 'paper', 'paper_max_hypotheses': 50}
    usual = find(gray, **parameters)
    assert len(usual) > 2
    assert_same(find(gray, DivisionModel(-0.4, gray.shape), **parameters), usual)


@pytest.mark.parametrize('lam', [-0.4, 0.0, 0.3])
@pytest.mark.parametrize('seed', range(3))
def test_scenes_through_a_known_lens_are_sound(seed, lam):
    gray = scene(seed)
    arcs = find(gray, DivisionModel(lam, gray.shape, (100.0, 70.0)))
    assert len(arcs) > 3
    assert_sound(arcs, gray)


def test_a_lens_is_of_one_frame_alone():
    detector, gray = Detector(), scene(1)
    lens = DivisionModel(-0.4, gray.shape)
    usual, known = detector.detect(gray), detector.detect(gray, lens=lens)
    assert known.table.tobytes() != usual.table.tobytes()
    assert_same(detector.detect(gray), usual)
    assert_same(detector.detect(gray, lens=lens), known)


def bends(arcs: Arcs, lens: DivisionModel) -> np.ndarray:
    """Return how far the sagitta of each arc is from that of a straight edge's picture, px."""
    table = arcs.table
    chord = table['end'] - table['start']
    left = np.column_stack([chord[:, 1], -chord[:, 0]]) / np.hypot(*chord.T)[:, None]
    off = table['curvature'] - lens.curvature(table['middle'], left)
    return np.abs(off) * table['length'] ** 2 / 8


@pytest.mark.parametrize('lam', [-0.6, -0.25])
def test_short_arcs_are_more_exact_through_a_known_lens(lam):
    room = Scene(640, 480, lam)
    usual, known = [], []
    for number in (0, 300):
        gray = room.image(number)
        for errors, lens in ((usual, None), (known, room.lens)):
            arcs = find(gray, lens)
            errors.extend(bends(arcs, room.lens)[arcs.table['length'] < 80])
    assert len(usual) > 100 and len(known) > 0.9 * len(usual)
    assert np.median(known) < 0.75 * np.median(usual)


def test_look_replaces_the_gradients_and_keeps_noise_and_thresholds():
    random = np.random.default_rng(3)
    first, second = random.integers(0, 255, (2, 60, 80)).astype(np.uint8)
    detector, other = Detector(), Detector()
    detector.detect(first)
    before = detector.frame
    detector.look(second)
    other.detect(second)
    after, wanted = detector.frame, other.frame
    assert (after.noise, after.blur, after.low, after.high) == (
        before.noise, before.blur, before.low, before.high)
    assert before.blur == wanted.blur and np.array_equal(after.dx, wanted.dx)
    assert len(detector.detect(second)) == len(other.detect(second))


def test_look_needs_an_image_of_the_same_size_before():
    detector = Detector()
    with pytest.raises(ValueError, match='must be that of the last image'):
        detector.look(np.zeros((60, 80), np.uint8))
    detector.detect(np.zeros((60, 80), np.uint8))
    with pytest.raises(ValueError, match=r'\(50, 80\): must be that of the last image'):
        detector.look(np.zeros((50, 80), np.uint8))
