"""The method as printed, worked by hand, and as the oracle for the other one."""
from __future__ import annotations

import dataclasses

from finding import find, samples
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core import paper, Parameters
from qflsd_ros.core.arcs import TABLE
from rendering import disk, off_circle, polygon, render

SETTINGS = Parameters(method='paper', paper_epsilon=300.0, paper_confidence=0.999)


@pytest.mark.parametrize(('length', 'n', 'confidence', 'k'), [
    (100, 100, 0.99, 1),        # P = 0: every triple lies on it
    (50, 100, 0.99, 35),        # ln 0.01 / ln (1 - 1/8) = 34.49
    (90, 100, 0.99, 4),         # ln 0.01 / ln (1 - 0.729) = 3.53
    (10, 100, 0.99, 4603),      # ln 0.01 / ln 0.999 = 4602.9
    (50, 100, 0.5, 6),          # ln 0.5 / ln 0.875 = 5.19
    (20, 100, 0.99, 574),       # ln 0.01 / ln 0.992 = 573.3
])
def test_repetitions(length, n, confidence, k):
    assert paper.repetitions(length, n, confidence) == k


@given(st.integers(2, 5000), st.integers(1, 5000), st.floats(0.5, 0.9999))
def test_repetitions_suffice_and_no_more_than_needed(n, length, confidence):
    length = min(length, n)
    k, p = paper.repetitions(length, n, confidence), 1 - (length / n) ** 3
    assert k >= 1
    assert p ** k <= (1 - confidence) * (1 + 1e-9)
    assert k == 1 or p ** (k - 1) > (1 - confidence) * (1 - 1e-9)


@pytest.mark.parametrize(('fits', 'run'), [
    ('', (0, 0)), ('.', (0, 0)), ('#', (0, 1)), ('...', (0, 0)), ('##.', (0, 2)),
    ('.##', (1, 3)), ('#.##.###.#', (5, 8)), ('##.##', (0, 2)), ('#####', (0, 5))])
def test_longest_run(fits, run):
    assert paper.longest_run(np.array([mark == '#' for mark in fits], bool)) == run


@given(st.lists(st.booleans(), max_size=40))
def test_longest_run_is_the_longest(fits):
    first, last = paper.longest_run(np.array(fits, bool))
    runs = [j - i for i in range(len(fits)) for j in range(i + 1, len(fits) + 1)
            if all(fits[i:j])]
    assert all(fits[first:last])
    assert last - first == max(runs, default=0)


@pytest.mark.parametrize(('run', 'left'), [
    ((0, 4), [[4, 5, 6, 7, 8, 9]]),                     # Figure 2 (a)
    ((6, 10), [[0, 1, 2, 3, 4, 5]]),                    # (b)
    ((3, 7), [[0, 1, 2], [7, 8, 9]]),                   # (c)
    ((0, 10), [])])
def test_what_is_left_of_a_contour(run, left):
    contour = np.column_stack([np.arange(10), np.zeros(10)])
    assert [piece[:, 0].tolist() for piece in paper.remove(contour, run)] == left


@given(st.floats(-500, 500), st.floats(-500, 500), st.floats(20, 500), st.integers(3, 40))
def test_solve_on_an_exact_circle(x, y, radius, n):
    turn = np.linspace(0, 2, n)
    points = np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])
    e, f, g = paper.solve(points)
    assert np.allclose([-e / 2, -f / 2, np.sqrt(e * e / 4 + f * f / 4 - g)], [x, y, radius],
                       rtol=1e-4, atol=1e-2)
    assert np.abs(paper.error(points, np.array([e, f, g]))).max() < 1e-2


def test_error_is_about_the_diameter_times_the_distance():
    model = paper.solve(np.array([[100, 0], [0, 100], [-100, 0.0]]))
    assert np.allclose(paper.error(np.array([[0, 101.0], [99, 0], [0, 0]]), model),
                       [201, -199, -10000])


@pytest.mark.parametrize('points', [
    [[0, 0], [1, 1], [2, 2]], [[5, 3], [5, 9], [5, 4], [5, 1]], [[1, 1], [1, 1], [2, 7]]])
def test_collinear_points_have_no_circle(points):
    assert paper.solve(np.array(points, float)) is None


def test_a_contour_on_one_line_ends():
    line = np.column_stack([np.arange(50.0), np.zeros(50)])
    assert paper.longest_segment(line, SETTINGS, np.random.default_rng(0)) == (0, 0)


def test_the_longest_segment_is_found():
    turn = np.linspace(0, 1, 150)
    arc = np.round(np.column_stack([200 * np.cos(turn), 200 * np.sin(turn)]))
    wild = arc[-1] + np.cumsum(np.random.default_rng(0).integers(-3, 4, (50, 2)), axis=0)
    loose = dataclasses.replace(SETTINGS, paper_epsilon=800.0, paper_confidence=0.9999)
    first, last = paper.longest_segment(np.vstack([arc, wild]), loose, np.random.default_rng(0))
    assert first < 10 and 135 < last < 165


def test_describe():
    turn = np.linspace(0.2, 1.2, 201)
    row = np.zeros(1, TABLE)[0]
    paper.describe(row, np.column_stack([200 * np.cos(turn), 200 * np.sin(turn)]))
    assert np.isclose(abs(row['curvature']), 1 / 200) and np.isclose(row['length'], 200)
    assert np.allclose(row['middle'], [200 * np.cos(0.7), 200 * np.sin(0.7)])
    assert row['support'] == 201 and row['rms'] < 1e-6


def test_describe_what_runs_out_and_back():
    turn = np.linspace(0.2, 1.2, 201)
    arc = np.column_stack([200 * np.cos(turn), 200 * np.sin(turn)])
    row = np.zeros(1, TABLE)[0]
    paper.describe(row, np.vstack([arc[60:], arc[::-1], arc[:60]]))
    ends = sorted([row['start'].tolist(), row['end'].tolist()])
    assert ends == sorted([arc[0].tolist(), arc[-1].tolist()])
    assert np.isclose(abs(row['curvature']), 1 / 200) and np.isclose(row['length'], 200)
    assert row['rms'] < 1e-6


def test_short_contours_are_left_out():
    gray = render((200, 200), polygon([(20, 20), (180, 20), (180, 180), (20, 180)]))
    gray[90:94, 90:94] = 60
    sizes = [[len(contour) for contour in paper.contours(
        gray, dataclasses.replace(SETTINGS, paper_min_contour=share))] for share in (0.0, 0.2)]
    assert min(sizes[0]) < 40 <= min(sizes[1]) and len(sizes[1]) < len(sizes[0])


def test_same_seed_same_segments():
    gray = render((200, 200), disk(100, 300, 220), noise=8)
    one, again = (find(gray, **dataclasses.asdict(SETTINGS)) for _ in range(2))
    other = find(gray, **dataclasses.asdict(SETTINGS) | {'paper_seed': 1})
    assert one.table.tobytes() == again.table.tobytes() != other.table.tobytes()


@pytest.mark.parametrize('angle', [0.3, 1.9, 3.6, 5.2])
@pytest.mark.parametrize('radius', [150, 250, 400])
def test_both_methods_find_the_same_arc(radius, angle):
    x, y = 119.5 + (radius - 30) * np.cos(angle), 99.5 + (radius - 30) * np.sin(angle)
    gray = render((200, 240), disk(x, y, radius))
    ours = find(gray)
    # E of equation (10) is the distance times the diameter: the same tolerance at this radius.
    theirs = find(gray, **dataclasses.asdict(SETTINGS) | {'paper_epsilon': 1.5 * 2 * radius})
    one, other = (int(np.argmax(arcs.table['length'])) for arcs in (ours, theirs))
    assert np.abs(off_circle(samples(theirs, other), x, y, radius)).max() < 2
    assert np.abs(off_circle(samples(ours, one), x, y, radius)).max() < 0.5
    ends = np.array([[arcs.table[i][name] for name in ('start', 'end')]
                     for arcs, i in ((ours, one), (theirs, other))])
    apart = min(np.hypot(*(ends[0] - pair).T).max() for pair in (ends[1], ends[1][::-1]))
    assert apart < 6


def test_results_of_the_paper_have_the_same_form():
    arcs = find(render((200, 240), disk(119.5, 350, 300)), **dataclasses.asdict(SETTINGS))
    assert len(arcs) > 0 and arcs.table.dtype == TABLE
    assert arcs.table['support'].tolist() == [len(arcs.pixels(i)) for i in range(len(arcs))]
    assert np.array_equal(arcs.points(0), arcs.pixels(0))
    assert len(arcs.polylines()) == len(arcs)
