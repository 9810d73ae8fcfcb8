"""The walk through the room: true edges of tracks, and the parts of edges in sight."""
from __future__ import annotations

from benchmark.scenes.walk import BINS, Walk
import numpy as np
import pytest

FRAMES = range(12)


@pytest.fixture(scope='module')
def walk() -> Walk:
    return Walk(-0.5, 2.0, (240, 320))


def test_tracks_depict_edges_in_whose_planes_they_lie(walk: Walk) -> None:
    seen = walk.see(FRAMES)
    edges = walk.depicted(seen)
    assert len(edges) > 20
    one = seen[-1]
    for track, plane in zip(one.tracks.tolist(), one.planes.normals):
        if track in edges:
            ends = (walk.edges[edges[track]] - one.pose.centre) @ one.pose.rotation
            rays = ends / np.linalg.norm(ends, axis=1, keepdims=True)
            assert np.abs(rays @ plane).max() < 0.1     # the longest reach far beyond the arc
    shown = np.array([edges.get(track, 0) for track in one.tracks.tolist()])
    parts = walk.parts(one, shown)[[track in edges for track in one.tracks.tolist()]]
    # Some arcs go on along a second edge in line with theirs.
    assert np.mean((parts > -0.1) & (parts < 1.1)) > 0.9


def test_edges_in_sight_are_those_of_the_exact_arcs(walk: Walk) -> None:
    counts = walk.visible(range(0, 12, 4))
    assert counts.shape == (len(walk.edges), BINS) and counts.max() == 3
    # Behind the camera nothing is in sight.
    seen = walk.see(range(1))[0]
    depth = ((walk.edges - seen.pose.centre) @ seen.pose.rotation)[..., 2]
    behind = (depth < -2).all(axis=1)
    assert behind.any() and not counts[behind].any()


def test_another_camera_is_beside(walk: Walk) -> None:
    shifted = Walk(-0.5, 2.0, (240, 320), (0.2, 0.0, 0.0))
    here, there = walk.see(range(3))[-1].pose, shifted.see(range(3))[-1].pose
    assert there.relative_to(here).centre == pytest.approx((0.2, 0, 0))
    assert there.rotation == pytest.approx(here.rotation)


def test_edges_lie_on_surfaces_and_the_camera_does_not(walk: Walk) -> None:
    assert walk.off_surfaces(walk.edges).max() < 1e-9
    assert walk.off_surfaces(walk.edges.mean(axis=1) + (0, 0, 0.01)).max() <= 0.01 + 1e-9
    assert walk.off_surfaces(walk.see(range(1))[0].pose.centre) > 0.3


@pytest.mark.slow
def test_lens_and_focal_length_are_estimated() -> None:
    unknown = Walk(-0.5, 2.0, (240, 320))
    bend, focal = unknown.estimate(range(60))
    assert 0 < abs(bend) < 0.03 and 0 < abs(focal) < 0.03
    known = Walk(-0.5, 2.0, (240, 320))
    assert (unknown.visible(range(1)) == known.visible(range(1))).all()
