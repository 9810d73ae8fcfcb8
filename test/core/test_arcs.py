"""The result: rows, chains, and polylines against the circles that they stand for."""
from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core import Arcs
from qflsd_ros.core.arcs import TABLE

angles = st.floats(-np.pi, np.pi)
places = st.tuples(st.floats(-100, 5000), st.floats(-100, 5000))


def arc(start: tuple[float, float], heading: float, length: float, turn: float) -> np.ndarray:
    """Return the row of an arc by where it starts, in which direction, and how far it turns."""
    def at(share: float) -> np.ndarray:
        angle = share * turn
        chord = share * length * np.sinc(angle / 2 / np.pi)
        return start + chord * np.array([np.cos(heading + angle / 2), np.sin(heading + angle / 2)])
    row = np.zeros((), TABLE)
    row['start'], row['middle'], row['end'] = at(0), at(0.5), at(1)
    row['curvature'], row['length'] = turn / length, length
    return row


def result(*rows: np.ndarray) -> Arcs:
    """Return arcs with 3 + i edge points behind arc i."""
    offsets = np.cumsum([0, *(3 + i for i in range(len(rows)))])
    pixels = np.arange(2 * offsets[-1], dtype=np.int32).reshape(-1, 2)
    return Arcs(np.stack(rows), pixels + 0.25, pixels, offsets)


def off(row: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return distances from the circle through start, middle and end, by plain geometry."""
    a, b, c = row['start'], row['middle'], row['end']
    matrix = 2 * np.array([b - a, c - a])
    centre = a + np.linalg.solve(matrix, [np.sum((b - a) ** 2), np.sum((c - a) ** 2)])
    return np.hypot(*(points - centre).T) - np.hypot(*(a - centre))


@given(places, angles, st.floats(10, 3000), st.floats(0.05, 3.1), st.sampled_from([-1, 1]),
       st.floats(0.02, 5))
def test_polyline_keeps_its_tolerance(start, heading, length, turn, side, tolerance):
    row = arc(start, heading, length, side * turn)
    points, = result(row).polylines(tolerance)
    assert np.abs(off(row, points)).max() < 1e-6
    assert np.abs(off(row, (points[1:] + points[:-1]) / 2)).max() <= tolerance + 1e-6
    assert np.allclose(points[[0, -1]], [row['start'], row['end']], rtol=0, atol=1e-8)
    if len(points) % 2:
        assert np.allclose(points[len(points) // 2], row['middle'], rtol=0, atol=1e-6)


@given(places, angles, st.floats(100, 3000), st.floats(0.2, 3.1), st.floats(0.02, 1))
def test_polyline_has_no_more_points_than_needed(start, heading, length, turn, tolerance):
    points, = result(arc(start, heading, length, turn)).polylines(tolerance)
    chords = len(points) - 1
    sagitta = length / turn * (1 - np.cos(turn / np.array([1, max(chords - 1, 1)]) / 2))
    if chords == 1:
        assert sagitta[0] <= tolerance * (1 + 1e-9)
    else:
        assert sagitta[0] > tolerance * (1 - 1e-9) and sagitta[1] > tolerance / 4 * (1 - 1e-9)


@given(places, angles, st.floats(1, 10000), st.sampled_from([-1, 1]), st.floats(0.01, 5))
def test_straight_to_within_tolerance_is_two_points(start, heading, length, side, tolerance):
    sagitta = 0.99 * min(tolerance, 0.1 * length)
    bent = arc(start, heading, length, side * 4 * np.arctan(2 * sagitta / length))
    straight = arc(start, heading, length, 0.0)
    for row, points in zip((bent, straight), result(bent, straight).polylines(tolerance)):
        assert np.allclose(points, [row['start'], row['end']], rtol=0, atol=1e-8)


def test_middle_of_a_right_turn():
    row = arc((0.0, 0.0), 0.0, np.pi * 50, np.pi)
    points, = result(row).polylines(0.01)
    assert np.allclose(points[-1], [0, 100])
    assert np.isclose(points[:, 0].max(), 50, rtol=0, atol=0.02)


def test_vertices_are_the_polylines():
    arcs = result(arc((0, 0), 0, 50, 1), arc((9, 9), 1, 50, 0), arc((0, 0), 2, 500, -2))
    points, counts = arcs.vertices(0.3)
    polylines = arcs.polylines(0.3)
    assert np.array_equal(points, np.concatenate(polylines))
    assert counts.tolist() == [len(polyline) for polyline in polylines]
    assert counts[1] == 2 < counts[0] < counts[2]


def test_default_tolerance_is_a_tenth_of_a_pixel():
    arcs = result(arc((0, 0), 0, 500, 1))
    assert np.array_equal(arcs.vertices()[0], arcs.vertices(0.1)[0])


@pytest.mark.parametrize('tolerance', [0, -1, float('nan')])
@pytest.mark.parametrize('arcs', [Arcs.empty(), result(arc((0, 0), 0, 50, 1))])
def test_tolerance_must_be_above_0(arcs, tolerance):
    for method in (arcs.vertices, arcs.polylines):
        with pytest.raises(ValueError, match=f'tolerance is {tolerance}: must be above 0 px'):
            method(tolerance)


def test_pixels_and_points():
    arcs = result(*(arc((0, 0), 0, 50, 1) for _ in range(4)))
    assert len(arcs) == 4
    assert [len(arcs.pixels(i)) for i in range(4)] == [3, 4, 5, 6]
    assert np.array_equal(np.concatenate([arcs.pixels(i) for i in range(4)]), arcs.edge_pixels)
    assert np.array_equal(np.concatenate([arcs.points(i) for i in range(4)]), arcs.edge_points)
    assert np.array_equal(arcs.pixels(-1), arcs.pixels(3))


@pytest.mark.parametrize('i', [2, -3])
def test_no_such_arc(i):
    arcs = result(arc((0, 0), 0, 50, 1), arc((0, 0), 0, 50, 1))
    for method in (arcs.pixels, arcs.points):
        with pytest.raises(IndexError):
            method(i)


def test_empty():
    arcs = Arcs.empty()
    assert len(arcs) == 0 and arcs.polylines() == []
    assert (arcs.table.shape, arcs.table.dtype) == ((0,), TABLE)
    assert arcs.edge_points.shape == arcs.edge_pixels.shape == (0, 2)
    assert arcs.offsets.tolist() == [0]
    points, counts = arcs.vertices()
    assert (points.shape, counts.shape) == ((0, 2), (0,))


@pytest.mark.parametrize('factor', [1, 2, 3])
def test_scaled_arcs_lie_on_the_image_that_many_times_as_large(factor):
    bent = arc((10.0, 20.0), 0.3, 50, 1.2)
    bent['rms'], bent['offset_std'], bent['curvature_std'] = 0.3, 0.02, 1e-4
    small = result(bent, arc((0.0, 0.0), 1, 50, 0))
    large = small.scaled(factor)
    for name in ('start', 'middle', 'end'):
        # The centre of the first pixel becomes the centre of the first block.
        assert np.allclose(large.table[name], small.table[name] * factor + (factor - 1) / 2)
    for mine, theirs in zip(large.polylines(0.1 * factor), small.polylines(0.1)):
        assert np.allclose(mine, theirs * factor + (factor - 1) / 2)
    for name, power in (('length', 1), ('rms', 1), ('offset_std', 1), ('curvature', -1),
                        ('curvature_std', -1), ('support', 0), ('score', 0)):
        assert np.allclose(large.table[name], small.table[name] * float(factor) ** power), name
    assert np.allclose(large.edge_points, small.edge_points * factor + (factor - 1) / 2)
    assert np.array_equal(large.edge_pixels // factor, small.edge_pixels)
    assert large.edge_pixels.dtype == np.int32
    assert [len(large.pixels(i)) for i in range(2)] == [3, 4]


def test_scaling_leaves_the_original_and_an_empty_result_alone():
    small = result(arc((10.0, 20.0), 0.3, 50, 1.2))
    before = small.table.copy()
    small.scaled(4)
    assert np.array_equal(small.table, before)
    assert len(Arcs.empty().scaled(2)) == 0


def test_samples_lie_evenly_from_start_to_end():
    arcs = result(arc((10.0, 20.0), 0.3, 50, 1.2), arc((0.0, 0.0), 1, 50, 0))
    points = arcs.samples(5)
    assert points.shape == (2, 5, 2)
    for place, name in ((0, 'start'), (2, 'middle'), (4, 'end')):
        assert np.allclose(points[:, place], arcs.table[name], rtol=0, atol=1e-9)
    assert np.abs(off(arcs.table[0], points[0])).max() < 1e-9
    steps = np.hypot(*np.diff(points, axis=1).T)
    assert np.allclose(steps, steps[0])
    assert Arcs.empty().samples(3).shape == (0, 3, 2)


def test_more_columns_come_in_their_order_into_a_copy():
    arcs = result(arc((0.0, 0.0), 0.0, 10.0, 0.0), arc((5.0, 5.0), 1.0, 20.0, 0.5))
    directed = arcs.with_columns(direction=np.array([2, -1]))
    both = directed.with_columns(straight=np.array([0.5, np.nan]))
    assert both.table.dtype.names == (*TABLE.names, 'straight', 'direction')
    assert both.table['direction'].tolist() == [2, -1] and both.table['straight'][0] == 0.5
    assert both.table['end'].tolist() == arcs.table['end'].tolist()
    assert directed.table.dtype.names == (*TABLE.names, 'direction')
    assert arcs.table.dtype == TABLE
    again = both.with_columns(direction=np.array([0, 0]))
    assert both.table['direction'][0] == 2 and again.table['direction'][0] == 0
