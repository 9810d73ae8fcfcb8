"""Figures of maps, of maps whose errors are known."""
from __future__ import annotations

from benchmark.experiments import mapping
import numpy as np
import pytest
from qflsd_ros.core.geometry.lines import Lines

EDGES = np.array([[[0.0, 0, 0], [1, 0, 0]], [[0, 1.0, 0], [0, 2, 0]]])


def lines(ends: np.ndarray, deviation: float = 0.01) -> Lines:
    """Return lines with these ends, 2 m away, with two directions across."""
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    directions = along / length[:, None]
    first = np.cross(directions, (0.3, 0.2, 1))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    across = np.stack([first, np.cross(directions, first)], axis=1)
    half, count = length[:, None] / 2 * (-1, 1), len(ends)
    return Lines(ends.mean(axis=1), directions, across, half,
                 np.tile(np.eye(4) * deviation ** 2, (count, 1, 1)), np.full(count, 100.0),
                 np.full(count, 2.0), np.zeros(count), np.full(count, 9))


def test_distances_are_those_from_the_nearest_edge() -> None:
    found = mapping.distances(mapping.samples(lines(EDGES + (0, 0, 0.05))), EDGES)
    assert found == pytest.approx(0.05)
    beyond = mapping.distances(np.array([[1.5, 0, 0]]), EDGES)
    assert beyond == pytest.approx(0.5)


@pytest.mark.parametrize('ends, share', [
    (EDGES, 1.0), (EDGES[:1], 0.5), (EDGES + (0, 0, 0.015), 1.0), (EDGES + (0, 0, 0.03), 0.0),
    (EDGES[:, ::-1], 1.0), ((EDGES + EDGES[:, :1]) / 2, 0.0)])
def test_edges_are_mapped_by_close_lines_along_most_of_them(ends: np.ndarray, share: float
                                                            ) -> None:
    visible = np.full((2, 50), 10)
    assert mapping.completeness(lines(ends), EDGES, visible) == (share, 2)


def test_edges_out_of_sight_do_not_count() -> None:
    visible = np.full((2, 50), 10)
    visible[1, 10:] = 0
    assert mapping.completeness(lines(EDGES[:1]), EDGES, visible) == (1.0, 1)


def test_errors_over_stated_deviations() -> None:
    random = np.random.default_rng(0)
    many = np.repeat(EDGES, 2000, axis=0)
    plain = lines(many)
    off = random.normal(0, 0.01, (len(many), 4))
    shift = np.einsum('nk,nki->ni', off[:, :2], plain.across)
    tilt = np.einsum('nk,nki->ni', off[:, 2:], plain.across)
    moved = np.stack([plain.points + shift + t * (plain.directions + tilt)
                      for t in (-0.5, 0.5)], axis=1)
    assert mapping.honesty(plain, moved) == pytest.approx(1, abs=0.05)
