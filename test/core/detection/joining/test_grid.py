"""Ends of pieces in cells, and the gaps between them."""
from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from qflsd_ros.core.detection.joining.grid import cell, gap_to, Grid, sort_ends

HEIGHT, WIDTH = 90, 130
seeds, angles = st.integers(0, 999), st.floats(-np.pi, np.pi)
TIP = (50.0, 40.0, 1.0, 0.0)        # an arc that goes on along x


def sort(ends: np.ndarray) -> Grid:
    """Return ends (M, 4) in their cells."""
    count = len(ends)
    return sort_ends(ends, np.empty(count, np.int64), np.empty((count, 4)), HEIGHT, WIDTH)


def gap(x: float, y: float, angle: float, longest: float = 60.0) -> float:
    """Return the gap from TIP to an end whose tangent points outward at an angle."""
    grid = sort(np.array([[x, y, np.cos(angle), np.sin(angle)]]))
    return gap_to(TIP, grid, 0, longest)


@given(seeds, st.integers(0, 60))
def test_every_end_is_in_its_cell_once(seed, count):
    ends = np.random.default_rng(seed).uniform(-5, 135, (count, 4))
    grid = sort(ends)
    assert sorted(grid.order.tolist()) == list(range(count))
    assert (grid.places == ends[grid.order]).all()
    for row in range(grid.rows):
        for column in range(grid.columns):
            at = row * grid.columns + column
            for k in range(grid.begins[at], grid.begins[at + 1]):
                x, y = grid.places[k, :2]
                assert cell(x, grid.columns) == column
                assert cell(y, grid.rows) == row
    assert grid.begins[-1] == count


def test_what_comes_towards_the_tip_may_go_on_it():
    assert np.isclose(gap(60, 40, np.pi), 10)
    assert np.isclose(gap(48, 40, np.pi), 2)        # pieces may overlap a little


@given(angles)
def test_what_does_not_may_not(angle):
    assert np.isinf(gap(30, 40, angle))             # behind
    assert np.isinf(gap(60, 46, angle))             # beside
    assert np.isinf(gap(115, 40, angle))            # too far away
    if abs(abs(angle) - np.pi) > np.radians(10):
        assert np.isinf(gap(60, 40, angle))         # in another direction
