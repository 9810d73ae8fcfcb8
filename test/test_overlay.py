"""The overlay: where arcs are drawn, in which colours, at what cost."""
from __future__ import annotations

from dataclasses import replace
from time import process_time

import numpy as np
import pytest

from qflsd_ros.core.arcs import Arcs, TABLE, TRACKED_TABLE
from qflsd_ros.overlay import colours, draw, NO_TAILS, Trails


def arcs_of(rows: list[tuple[tuple[float, float], tuple[float, float], float]]) -> Arcs:
    """Return arcs from start, end and curvature (1/px) of each, without any edge points."""
    table = np.zeros(len(rows), TABLE)
    for row, (start, end, curvature) in zip(table, rows):
        chord = np.hypot(*np.subtract(end, start))
        row['start'], row['end'], row['curvature'] = start, end, curvature
        row['length'] = chord
        if curvature:
            row['length'] = 2 / abs(curvature) * np.arcsin(chord * abs(curvature) / 2)
    return Arcs(table, np.zeros((0, 2)), np.zeros((0, 2), np.int32),
                np.zeros(len(rows) + 1, np.int64))


def ink(overlay: np.ndarray) -> np.ndarray:
    """Return how much was drawn on a black frame: (H, W) float."""
    return overlay.max(axis=2).astype(float)


@pytest.mark.parametrize('line_width', [1, 2, 3])
@pytest.mark.parametrize('y', [10.0, 10.25, 10.5, 10.75])
def test_pixel_centres_are_whole_numbers(y: float, line_width: int) -> None:
    """A line at height y has the centre of mass of its ink at y."""
    overlay = draw(np.zeros((20, 40), np.uint8), arcs_of([((5, y), (35, y), 0)]), line_width)
    column = ink(overlay)[:, 20]
    assert column @ np.arange(20) / column.sum() == pytest.approx(y, abs=0.2)


def test_bent_arcs_are_drawn_bent() -> None:
    """The ink of a quarter circle lies at its radius, nowhere else."""
    overlay = draw(np.zeros((60, 60), np.uint8), arcs_of([((50, 0), (0, 50), 1 / 50)]), 1)
    y, x = np.nonzero(ink(overlay) > 60)
    assert len(x) >= 70
    assert np.abs(np.hypot(x, y) - 50).max() < 1.3


def test_wider_lines_have_more_ink() -> None:
    """A wider line covers more of the frame."""
    arcs = arcs_of([((5, 10), (35, 12), 0)])
    amounts = [ink(draw(np.zeros((20, 40), np.uint8), arcs, width)).sum() for width in (1, 2, 4)]
    assert amounts[0] < amounts[1] < amounts[2]


@pytest.mark.parametrize('shape', [(20, 40), (20, 40, 3)])
def test_the_frame_shows_beside_the_arcs_and_stays_as_it_was(shape: tuple[int, ...]) -> None:
    """Grey and colour frames are copied, any memory layout; only arcs are drawn over."""
    frame = np.random.default_rng(0).integers(0, 255, shape, np.uint8)[:, ::-1]
    before = frame.copy()
    overlay = draw(frame, arcs_of([((5, 10), (35, 10), 0)]), 1)
    assert overlay.shape == (20, 40, 3)
    assert overlay.dtype == np.uint8 and overlay.flags['C_CONTIGUOUS']
    np.testing.assert_array_equal(frame, before)
    expected = before if before.ndim == 3 else before[..., None].repeat(3, axis=2)
    np.testing.assert_array_equal(overlay[:7], expected[:7])
    assert (overlay[10, 10:30] != expected[10, 10:30]).any(axis=1).all()


def test_no_arcs_leave_the_frame_alone() -> None:
    """Without arcs the overlay is the frame."""
    frame = np.arange(60, dtype=np.uint8).reshape(6, 10)
    np.testing.assert_array_equal(draw(frame, Arcs.empty()), frame[..., None].repeat(3, axis=2))


def test_arcs_beyond_the_frame_are_clipped() -> None:
    """An arc that leaves the frame is drawn up to the rim, far ends do no harm."""
    arcs = arcs_of([((-1000, 10), (1000, 10), 0), ((1e5, 1e5), (2e5, 1e5), 0)])
    assert (ink(draw(np.zeros((20, 40), np.uint8), arcs, 1))[10] > 100).all()


def test_colours_are_stable_and_apart() -> None:
    """A colour depends on the number of its arc alone; neighbours differ clearly."""
    many = colours(np.arange(40)).astype(int)
    np.testing.assert_array_equal(colours(np.array([6, 2])), many[[6, 2]])
    assert len(np.unique(colours(np.arange(500)), axis=0)) == 500
    late = colours(np.arange(2 ** 24 - 40, 2 ** 24 + 1, dtype=np.uint32)).astype(int)
    for some in (many, late):
        for step in (1, 2, 3):
            assert np.abs(some[step:] - some[:-step]).max(axis=1).min() > 50
        assert some.max(axis=1).min() > 200


def middles_of(middles: dict[int, tuple[float, float]]) -> Arcs:
    """Return tracked arcs of no length from the middle of each track."""
    table = np.zeros(len(middles), TRACKED_TABLE)
    table['track'], table['middle'] = list(middles), list(middles.values())
    return replace(Arcs.empty(), table=table, offsets=np.zeros(len(middles) + 1, np.int64))


def test_trails_are_the_last_steps_of_tracks_in_sight() -> None:
    """As many as wanted; one that was away has no step over the frames without it."""
    trails = Trails()
    assert not len(trails.follow(middles_of({7: (0, 0), 3: (9, 9)}), 2).tracks)
    tails = trails.follow(middles_of({3: (9, 8), 7: (1, 0)}), 2)
    assert tails.tracks.tolist() == [3, 7]
    assert tails.steps.tolist() == [[[9, 9], [9, 8]], [[0, 0], [1, 0]]]
    tails = trails.follow(middles_of({7: (2, 0)}), 2)
    assert tails.tracks.tolist() == [7, 7]
    assert tails.steps.tolist() == [[[0, 0], [1, 0]], [[1, 0], [2, 0]]]
    tails = trails.follow(middles_of({7: (3, 0), 3: (9, 5)}), 2)
    assert tails.tracks.tolist() == [7, 7]
    assert tails.steps.tolist() == [[[1, 0], [2, 0]], [[2, 0], [3, 0]]]


@pytest.mark.parametrize('arcs, count', [
    (Arcs.empty(), 5), (middles_of({1: (5, 5)}), 0)], ids=['without tracks', 'not wanted'])
def test_a_frame_without_trails_ends_them(arcs: Arcs, count: int) -> None:
    trails = Trails()
    for x in range(3):
        trails.follow(middles_of({1: (x, 0)}), 5)
    assert trails.follow(arcs, count) is NO_TAILS
    trails.follow(Arcs.empty(), 5)
    assert not len(trails.follow(middles_of({1: (9, 0)}), 5).tracks)


def test_tails_are_drawn_in_the_colour_of_their_track() -> None:
    trails = Trails()
    trails.follow(middles_of({8: (5, 10), 9: (5, 15)}), 1)
    tails = trails.follow(middles_of({8: (35, 10), 9: (35, 15)}), 1)
    picture = draw(np.zeros((20, 40), np.uint8), Arcs.empty(), 1, tails)
    assert picture[[10, 15], 20] == pytest.approx(colours(np.array([8, 9])), rel=0.12)
    assert not picture[:8].any()


def test_drawing_keeps_up_with_a_camera() -> None:
    """1280x720 with 500 arcs takes a small part of a 30 Hz frame, in CPU time."""
    generator = np.random.default_rng(0)
    start = generator.uniform((0, 0), (1280, 720), (500, 2))
    angle, length = generator.uniform(0, 2 * np.pi, 500), generator.uniform(15, 100, 500)
    end = start + length[:, None] * np.c_[np.cos(angle), np.sin(angle)]
    arcs = arcs_of(list(zip(start, end, generator.uniform(-0.005, 0.005, 500))))
    frame = np.zeros((720, 1280), np.uint8)
    times = []
    for _ in range(10):
        begin = process_time()
        draw(frame, arcs)
        times.append(process_time() - begin)
    assert min(times) < 0.015
