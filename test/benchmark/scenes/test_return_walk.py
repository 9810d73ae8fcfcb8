"""A walk in the room: points on edges are carried along the edges, where these are in sight."""
from __future__ import annotations

from benchmark.metrics import Comparison, sample
from benchmark.scenes.return_walk import ReturnWalk
import numpy as np
import pytest
from qflsd_ros.sources import Scene

SHAPE = 240, 320


def arcs(number: int, lam: float) -> list[np.ndarray]:
    """Return the exact arcs of the room in a frame of its own path."""
    return Scene(SHAPE[1], SHAPE[0], lam).truth(number).polylines(0.02)


@pytest.mark.parametrize('lam', [0.0, -0.6])
def test_arcs_go_on_exact_arcs(lam):
    walk = ReturnWalk(SHAPE, lam, 40, 300)
    pieces = sample(arcs(300, lam))
    moved = walk.carry(pieces, 0, 10)
    seen = np.isfinite(moved[:, 0])
    assert 0.5 < seen.mean() < 1
    assert np.linalg.norm(moved - pieces.points, axis=1)[seen].max() > 10
    parts = [moved[seen & (pieces.line == line)] for line in range(pieces.count)]
    there = sample([part for part in parts if len(part) > 10])
    matched = Comparison(there, sample(arcs(320, lam))).lines(0.5, 20.0)[0] >= 0
    assert matched.mean() > 0.97


def test_the_walk_returns():
    walk = ReturnWalk(SHAPE, 0.0, 6, 0)
    assert len(walk) == 6
    assert np.array_equal(walk.frame(0), walk.frame(5))
    assert not np.array_equal(walk.frame(0), walk.frame(2))
    pieces = sample(arcs(0, 0.0))
    moved = walk.carry(pieces, 0, 5)
    seen = np.isfinite(moved[:, 0])
    assert moved[seen] == pytest.approx(pieces.points[seen], abs=2)
    assert np.median(np.abs(moved - pieces.points)[seen]) < 0.01


def test_points_on_no_edge_are_nowhere():
    walk = ReturnWalk(SHAPE, 0.0, 6, 0)
    pieces = sample([np.array([[20.0, 20], [50, 220]])])
    on_edges = Comparison(pieces, sample(arcs(0, 0.0))).lines(2.0, 5.0)[0] >= 0
    assert np.isnan(walk.carry(pieces, 0, 1)[~on_edges]).all()
