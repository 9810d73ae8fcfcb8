"""The map of lines: what it confirms, what it removes, and what it keeps of a track."""
from __future__ import annotations

import numpy as np
from posed import edges, poses, sight
import pytest
from qflsd_ros.core.geometry import line_map
from qflsd_ros.core.geometry.line_map import LineMap
from qflsd_ros.core.pose import Pose

LINES = edges(30)
TRACKS = np.arange(1, 31)


def show(world: LineMap, ways: list[Pose], tracks: np.ndarray = TRACKS,
         lines: np.ndarray = LINES, seed: int = 0) -> None:
    random = np.random.default_rng(seed)
    for pose in ways:
        world.add(tracks, sight(lines, pose, 1e-5, random), pose)


def test_lines_of_a_moving_camera_are_confirmed():
    world = LineMap()
    show(world, poses(40))
    found = world.lines()
    assert len(found.tracks) > 25
    assert found.seen.tolist() == [40] * len(found.tracks)
    assert found.lines.ends == pytest.approx(LINES[found.tracks - 1], abs=0.02)


def test_a_camera_that_stands_confirms_nothing():
    world = LineMap()
    show(world, [Pose(np.eye(3), np.zeros(3))] * 40)
    assert len(world.lines().tracks) == 0
    assert len(world) == 30


def test_standing_after_a_move_loses_nothing():
    world, ways = LineMap(), poses(20)
    show(world, ways)
    before = world.lines()
    show(world, ways[-1:] * 100)
    after = world.lines()
    assert set(before.tracks) <= set(after.tracks)
    assert np.median(after.lines.deviations) < 1.3 * np.median(before.lines.deviations)


def test_a_line_is_confirmed_after_some_images():
    world, ways = LineMap(), poses(12)
    show(world, ways[:line_map.LEAST_SEEN - 1])
    assert len(world.lines().tracks) == 0
    show(world, ways[line_map.LEAST_SEEN - 1:])
    assert len(world.lines().tracks) > 20


def test_planes_without_a_track_are_left_out():
    world = LineMap()
    show(world, poses(10), np.zeros(30, int))
    assert len(world) == 0 and len(world.lines().tracks) == 0


def test_what_is_not_confirmed_is_removed_and_the_rest_stays():
    world, ways = LineMap(), poses(20)
    show(world, ways[:3], TRACKS + 100)
    show(world, ways)
    known = world.lines().tracks
    assert len(world) == 60
    nothing = np.zeros((0, 2, 3))
    for _ in range(line_map.PATIENCE + 1):
        show(world, ways[:1], np.zeros(0, int), nothing)
    assert world.lines().tracks.tolist() == known.tolist()
    assert len(world) == len(known)


def test_the_memory_is_flat(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(line_map, 'CAPACITY', 50)
    world, ways = LineMap(), poses(15)
    for round_ in range(4):
        show(world, ways, TRACKS + 30 * round_, LINES + (0.1 * round_, 0, 0))
        assert len(world) <= 50
    # The newest are there.
    newest = world.lines().tracks
    assert (newest > 90).sum() > 20


def test_an_image_without_planes():
    world = LineMap()
    show(world, poses(2), np.zeros(0, int), np.zeros((0, 2, 3)))
    assert len(world.lines().tracks) == 0


def test_views_are_kept_over_the_whole_way():
    """The error follows from the whole way, not from its end."""
    world, ways = LineMap(), poses(300)
    show(world, ways)
    late = LineMap()
    show(late, ways[-line_map.VIEWS:])
    whole, end = world.lines(), late.lines()
    assert np.median(whole.lines.distances * whole.lines.deviations) < 0.005
    assert len(end.tracks) < len(whole.tracks)


def test_a_track_that_shows_a_known_line_continues_it():
    world, ways = LineMap(), poses(60)
    show(world, ways[:25])
    before = world.lines()
    show(world, ways[35:], TRACKS + 100, seed=1)
    after = world.lines()
    again = np.isin(after.tracks, before.tracks) & (after.seen == 50)
    assert again.sum() > 20
    known = np.isin(before.tracks, after.tracks[again])
    assert (np.median(after.lines.chosen(again).deviations)
            < 0.7 * np.median(before.lines.chosen(known).deviations))
    off = after.lines.chosen(again).ends - LINES[after.tracks[again] - 1]
    assert np.abs(off).max() < 0.02


def test_a_line_goes_on_under_the_track_that_continues_it():
    world, ways = LineMap(), poses(60)
    show(world, ways[:20])
    show(world, ways[25:45], TRACKS + 100, seed=1)
    count = len(world.lines().tracks)
    show(world, ways[45:], TRACKS + 100, seed=2)
    after = world.lines()
    assert len(after.tracks) == count
    assert (after.seen == 55).sum() > 20


def test_a_united_line_is_removed_with_all_its_tracks(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(line_map, 'CAPACITY', 70)
    world, ways = LineMap(), poses(60)
    show(world, ways[:20])
    show(world, ways[25:45], TRACKS + 100, seed=1)
    assert (world.lines().seen == 40).sum() > 20
    elsewhere = LINES + (0, 0, 4)
    for round_ in range(2, 6):
        show(world, ways, TRACKS + 100 * round_, elsewhere, seed=round_)
        assert len(world) <= 70
    show(world, ways, TRACKS + 100, seed=1)
    assert len(world.lines().tracks) <= 70
