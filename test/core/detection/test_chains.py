"""Chains: each pixel once, neighbour after neighbour, straight on where edges meet."""
from __future__ import annotations

import cv2
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from qflsd_ros.core.detection import chains
from qflsd_ros.core.detection.edges import STRONG, WEAK

maps = arrays(np.uint8, st.tuples(st.integers(3, 25), st.integers(3, 25)),
              elements=st.sampled_from([0, 0, WEAK, STRONG]), fill=st.just(0))


def bordered(edges: np.ndarray) -> np.ndarray:
    """Return an edge map with nothing in its outermost rows and columns, as ``thin`` leaves it."""
    return np.pad(edges[1:-1, 1:-1], 1)


def trace(edges: np.ndarray, shortest: int = 1, dx: int | np.ndarray = 3,
          dy: int | np.ndarray = 4) -> list[np.ndarray]:
    """Return the chains of an edge map with given gradients, each (n, 2) of x, y."""
    flat = np.zeros((edges.size + 7) // 8 * 8, np.uint8)
    flat[:edges.size] = edges.ravel()
    size = max(np.count_nonzero(edges), 1)
    pixels, width = np.empty(size, np.int32), edges.shape[1]
    offsets = np.empty(size // shortest + 2, np.int64)
    gradients = (np.broadcast_to(d, edges.shape).astype(np.int16).ravel() for d in (dx, dy))
    count = chains.trace(*gradients, flat, flat.view(np.uint64), chains.steps(width), shortest,
                         pixels, offsets)
    assert not (flat == STRONG).any()
    return [np.column_stack([pixels[a:b] % width, pixels[a:b] // width])
            for a, b in zip(offsets[:count], offsets[1:count + 1])]


def drawn(*lines: tuple[tuple[int, int], tuple[int, int]]) -> np.ndarray:
    """Return the edge map of lines one pixel wide."""
    edges = np.zeros((60, 80), np.uint8)
    for start, end in lines:
        cv2.line(edges, start, end, STRONG)
    return edges


@given(maps, st.sampled_from([1, 3, 8]), st.integers(-9, 9), st.integers(1, 9))
def test_chains_of_any_edge_map(edges, shortest, dx, dy):
    edges = bordered(edges)
    found = trace(edges, shortest, dx, dy)
    for chain in found:
        assert len(chain) >= shortest
        assert edges[chain[:, 1], chain[:, 0]].all()
        assert (edges[chain[:, 1], chain[:, 0]] == STRONG).any()
        assert (np.abs(np.diff(chain, axis=0)).max(axis=1, initial=0) == 1).all()
    pixels = [tuple(pixel) for chain in found for pixel in chain]
    assert len(pixels) == len(set(pixels))
    if shortest == 1:
        strong = {(x, y) for y, x in np.argwhere(edges == STRONG)}
        assert strong <= set(pixels)


@given(maps)
def test_same_map_same_chains(edges):
    edges = bordered(edges)
    for one, other in zip(trace(edges), trace(edges), strict=True):
        assert np.array_equal(one, other)


@given(st.integers(5, 74), st.integers(5, 54), st.integers(5, 74), st.integers(5, 54))
def test_a_line_is_one_open_chain(x0, y0, x1, y1):
    edges = drawn(((x0, y0), (x1, y1)))
    if x0 == x1 and y0 == y1:
        return
    chain, = trace(edges, 1, y0 - y1, x1 - x0)
    assert len(chain) == np.count_nonzero(edges)
    assert {tuple(chain[0]), tuple(chain[-1])} == {(x0, y0), (x1, y1)}


@given(st.integers(10, 25), st.floats(0, 2 * np.pi), st.floats(1, 4))
def test_an_open_arc_is_one_chain(radius, begin, turn):
    edges = np.zeros((60, 80), np.uint8)
    cv2.ellipse(edges, (40, 30), (radius, radius), np.degrees(begin), 0, np.degrees(turn), STRONG)
    y, x = np.indices(edges.shape)
    chain = max(trace(edges, 1, 100 * (x - 40), 100 * (y - 30)), key=len)
    # Where it is drawn two pixels wide, one of them may be left over.
    assert len(chain) >= 0.85 * np.count_nonzero(edges)
    assert np.hypot(*(chain[-1] - chain[0])) > 1


@pytest.mark.parametrize('lines', [
    [((10, 30), (70, 30)), ((40, 10), (40, 50))],
    [((20, 10), (60, 50)), ((20, 50), (60, 10))],
    [((10, 10), (70, 40)), ((20, 50), (60, 10))],
])
def test_straight_on_at_a_crossing(lines):
    edges, dx, dy = drawn(*lines), *np.ones((2, 60, 80), int)
    for (x0, y0), (x1, y1) in lines:
        on = drawn(((x0, y0), (x1, y1))) > 0
        dx[on], dy[on] = y0 - y1, x1 - x0
    found = trace(edges, 4, dx, dy)
    for chain in found:
        (x0, y0), (x1, y1) = chain[0], chain[-1]
        off = (x1 - x0) * (chain[:, 1] - y0) - (y1 - y0) * (chain[:, 0] - x0)
        assert np.abs(off).max() <= 1.5 * np.hypot(x1 - x0, y1 - y0)
    assert len(found) == 3
    assert sum(map(len, found)) >= np.count_nonzero(edges) - 3


def test_one_chain_runs_over_the_whole_of_a_closed_edge():
    edges = np.zeros((60, 80), np.uint8)
    cv2.circle(edges, (40, 30), 20, STRONG)
    chain = max(trace(edges), key=len)
    assert len(chain) == np.count_nonzero(edges)
    assert np.abs(chain[0] - chain[-1]).max() == 1


def test_weak_edges_go_on_but_do_not_begin():
    edges = np.zeros((20, 60), np.uint8)
    edges[5, 5:50] = WEAK
    edges[10, 5:50] = WEAK
    edges[10, 30] = STRONG
    chain, = trace(edges, 1, 0, 4)
    assert sorted(chain.tolist()) == [[x, 10] for x in range(5, 50)]


@pytest.mark.parametrize(('length', 'found'), [(7, 0), (8, 1)])
def test_short_chains_are_left_out(length, found):
    assert len(trace(drawn(((10, 10), (9 + length, 10))), 8, 0, 4)) == found


def test_nothing():
    assert trace(np.zeros((9, 9), np.uint8)) == []
