"""The published search, with distances in px: finds what it should on chains made by hand."""
from __future__ import annotations

from benchmark.experiments import triples
import numpy as np

SIDE = np.arange(40.0)


def test_a_straight_chain_is_one_run() -> None:
    """Also along an axis, where every triple is collinear."""
    points = np.column_stack([SIDE, np.zeros(40)])
    assert triples.search(points, 0.5, 10, 0) == [(0, 39)]


def test_a_circle_is_one_run() -> None:
    """As exact as its points are."""
    turn = np.linspace(0, 3, 100)
    points = 50 * np.column_stack([np.cos(turn), np.sin(turn)])
    assert triples.search(points, 0.1, 10, 0) == [(0, 99)]


def test_a_corner_parts_two_runs() -> None:
    """Together they hold nearly all points, each once."""
    points = np.concatenate([np.column_stack([SIDE, 0 * SIDE]),
                             np.column_stack([39 + 0 * SIDE[1:], SIDE[1:]])])
    found = sorted(triples.search(points, 0.5, 10, 0))
    assert len(found) == 2 and found[0][1] < found[1][0]
    assert sum(last - first + 1 for first, last in found) > 70


def test_a_contour_that_runs_out_and_back() -> None:
    """Pixels that are passed twice determine no circle."""
    points = np.column_stack([np.r_[SIDE, SIDE[::-1]], np.zeros(80)])
    assert triples.search(points, 0.5, 10, 0) == [(0, 79)]


def test_too_short_a_chain_has_no_run() -> None:
    """Nothing is found, and the search ends."""
    assert triples.search(np.random.default_rng(0).uniform(0, 99, (9, 2)), 0.5, 10, 0) == []
