"""Of close parallel arcs the longest; both sides of a line, and arcs apart or across, stay."""
from __future__ import annotations

from finding import find
import numpy as np
import pytest
from rendering import disk, half_plane, render

SHAPE = (160, 200)


def stroke(region, width: float):
    """Return what lies within half a width of a region's edge."""
    return lambda u, v: width / 2 - np.abs(region(u, v))


@pytest.mark.parametrize('angle', np.radians([0, 20, 45, 70, 90]))
def test_both_sides_of_a_thin_line_are_kept(angle):
    gray = render(SHAPE, stroke(half_plane(99.5, 79.5, angle), 2))
    table = find(gray).table
    assert len(table) == 2
    one, two = table['end'] - table['start']
    assert one @ two < 0                # each has the brighter side on its right
    # A distance of more than twice the width asks for one of them.
    assert len(find(gray, min_distance=8.0)) == 1


@pytest.mark.parametrize('angle', np.radians([0, 20, 45, 70, 90]))
def test_a_wide_line_is_two_arcs(angle):
    arcs = find(render(SHAPE, stroke(half_plane(99.5, 79.5, angle), 10)), min_distance=5.0)
    assert len(arcs) == 2


@pytest.mark.parametrize('radius', [130, 200, 400])
def test_both_sides_of_a_thin_arc_are_kept(radius):
    # The ring's inner and outer edge, over up to a third of a turn.
    gray = render(SHAPE, stroke(disk(99.5, 20 + radius, radius), 2))
    assert len(find(gray)) == 2
    assert len(find(gray, min_distance=8.0)) == 1


@pytest.mark.parametrize('radius', [165, 180, 220, 300])
def test_a_bent_edge_is_one_arc(radius):
    # Where it runs at 45 degrees it is found two pixels wide.
    arcs = find(render((240, 320), disk(159.5, 20.3 + radius, radius)))
    assert len(arcs) == 1


@pytest.mark.parametrize('angle', np.radians([0, 30, 90]))
@pytest.mark.parametrize('distance', [6.5, 12.0, 30.0, 100.0])
def test_any_distance_takes_in_what_is_closer(angle, distance):
    # Two steps of the same polarity, 6 px apart.
    x, y = -3 * np.sin(angle), 3 * np.cos(angle)
    gray = (render(SHAPE, half_plane(99.5 - x, 79.5 - y, angle), 20, 120)
            + render(SHAPE, half_plane(99.5 + x, 79.5 + y, angle), 0, 100))
    assert len(find(gray, min_distance=distance)) == 1
    assert len(find(gray, min_distance=5.0)) == 2


def test_of_two_the_longer_is_left():
    gray = render(SHAPE, stroke(half_plane(99.5, 79.5, 0), 2))
    gray[60:78, 40:60] = gray[0, 0]
    gray[70:78, 40:90] = gray[0, 0]
    assert find(gray, min_distance=5.0).table['length'].max() > 190


def test_arcs_that_cross_stay():
    gray = render(SHAPE, lambda u, v: half_plane(99.5, 79.5, 0.1)(u, v)
                  * half_plane(99.5, 79.5, 0.5)(u, v))
    assert np.count_nonzero(find(gray, min_distance=5.0).table['length'] > 150) == 2


def test_pieces_of_one_line_stay():
    gray = render(SHAPE, half_plane(99.5, 79.5, 0))
    gray[:, 80:120] = 60
    arcs = find(gray, max_gap=0, min_distance=5.0)
    assert np.count_nonzero(np.abs(arcs.table['middle'][:, 1] - 79.5) < 1) == 2


@pytest.mark.parametrize('angle', [0.0, 0.3])
@pytest.mark.parametrize('step, count', [(25, 1), (100, 2)])
def test_a_faint_edge_close_beside_a_strong_one_is_its_halo(angle, step, count):
    strong, beside = half_plane(99.5, 79.5, angle), half_plane(99.5, 82.7, angle)
    gray = render(SHAPE, strong, 20, 140).astype(int)
    gray[:, 30:170] += step * (render(SHAPE, beside, 0, 100)[:, 30:170].astype(int)) // 100
    arcs = find(gray.astype(np.uint8))
    assert np.count_nonzero(arcs.table['length'] > 100) == count
