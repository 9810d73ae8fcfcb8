"""Arcs end where their edges end."""
from __future__ import annotations

from finding import find
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
import rendering

SHAPE = 140, 160
MIDDLE = np.array([79.7, 69.6])


def square(angle: float) -> np.ndarray:
    """Return the corners of a square of 80 px, clockwise as one sees the image, (4, 2) px."""
    turns = np.radians([0, 90, 180, 270]) + angle
    return MIDDLE + 40 * np.sqrt(2) * np.column_stack([np.cos(turns), np.sin(turns)])


@given(st.floats(0, np.pi / 2), st.integers(0, 10**6))
def test_sides_reach_their_corners(angle, seed):
    corners = square(angle)
    region = rendering.polygon([tuple(corner) for corner in corners])
    table = find(rendering.render(SHAPE, region, blur=0.8, noise=2, seed=seed)).table
    assert len(table) == 4
    for end in (*table['start'], *table['end']):
        assert np.hypot(*(corners - end).T).min() < 4


@pytest.mark.parametrize('angle', np.radians([0.5, 5, 30, 50, 80, 120]))
def test_edges_that_leave_the_image_reach_its_border(angle):
    region = rendering.half_plane(*MIDDLE, angle)
    row, = find(rendering.render(SHAPE, region, blur=0.8)).table
    for x, y in (row['start'], row['end']):
        assert min(x, y, SHAPE[1] - 1 - x, SHAPE[0] - 1 - y) < 0.75


def test_an_edge_ends_where_it_fades():
    gray = rendering.render(SHAPE, rendering.half_plane(*MIDDLE, 0.1), blur=0.8).astype(float)
    gray[:, 100:] = 120
    row, = (row for row in find(np.round(gray).astype(np.uint8)).table
            if abs(row['end'][0] - row['start'][0]) > 50)
    assert max(row['start'][0], row['end'][0]) < 102
