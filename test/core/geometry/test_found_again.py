"""Lines that are one are found, and those that only might be are not."""
from __future__ import annotations

import numpy as np
from posed import edges, poses, sight
from qflsd_ros.core.geometry.found_again import found_again
from qflsd_ros.core.geometry.lines import Lines
from qflsd_ros.core.geometry.triangulation import triangulate
from qflsd_ros.core.geometry.views import observed

NOISE = 1e-4
EDGES = edges(40)


def seen(ends: np.ndarray, frames: slice, seed: int) -> Lines:
    """Return the lines of edges, (N, 2, 3), by some frames of a way."""
    random, ways = np.random.default_rng(seed), poses(40)[frames]
    views = np.stack([observed(sight(ends, pose, NOISE, random), pose) for pose in ways], axis=1)
    return triangulate(views, np.full(len(ends), len(ways)))


def together(*parts: Lines) -> Lines:
    return Lines(*(np.concatenate(values) for values in zip(*parts)))


BEFORE, AFTER = seen(EDGES, slice(0, 18), 0), seen(EDGES, slice(22, 40), 1)
FIRST, LAST = np.repeat([0, 22], 40), np.repeat([17, 39], 40)


def test_edges_that_are_seen_twice_are_found():
    pairs = found_again(together(BEFORE, AFTER), FIRST, LAST)
    assert len(pairs) > 30
    assert (pairs[:, 1] == pairs[:, 0] + 40).all()


def test_the_earlier_one_comes_first():
    pairs = found_again(together(AFTER, BEFORE), FIRST[::-1], LAST[::-1])
    assert len(pairs) > 30
    assert (pairs[:, 0] == pairs[:, 1] + 40).all()


def test_lines_that_were_seen_at_once_are_two():
    assert len(found_again(together(BEFORE, AFTER), np.zeros(80, int), np.full(80, 39))) == 0


def test_an_edge_beside_another_might_be_either():
    """Each edge has a neighbour 1 mm away: seen again, it could be both."""
    beside = seen(EDGES + 1e-3, slice(0, 18), 2)
    first, last = np.repeat([0, 0, 22], 40), np.repeat([17, 17, 39], 40)
    assert len(found_again(together(BEFORE, beside, AFTER), first, last)) < 4


def test_the_two_sides_of_a_bar_are_two():
    turned = seen(EDGES[:, ::-1], slice(22, 40), 1)
    assert len(found_again(together(BEFORE, turned), FIRST, LAST)) == 0


def test_parts_of_an_edge_are_two():
    middle = EDGES.mean(axis=1, keepdims=True)
    first, second = EDGES.copy(), EDGES.copy()
    first[:, 1:], second[:, :1] = middle, middle
    lines = together(seen(first, slice(0, 18), 0), seen(second, slice(22, 40), 1))
    assert len(found_again(lines, FIRST, LAST)) < 3


def test_without_lines_there_are_no_pairs():
    nothing = BEFORE.chosen(np.zeros(40, bool))
    assert found_again(nothing, np.zeros(0, int), np.zeros(0, int)).shape == (0, 2)
