"""One arc from several pieces: what is joined, and what is not."""
from __future__ import annotations

from finding import find, only, samples
import hypothesis
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core import circle, DivisionModel
from qflsd_ros.core.detection import extraction
from qflsd_ros.core.detection.frame import curvature_limits, Frame, Limits
from qflsd_ros.core.detection.joining import joining, pieces
from qflsd_ros.core.detection.region import region
from rendering import (
    both, disk, half_plane, off_circle, off_line, polygon, render, through_lens)

WIDTH = 400
LEVEL = 40.3        # y of the edge that has a gap


def interrupted(gap: float, faint: float = 0.0) -> np.ndarray:
    """Return a bright half plane with a dark slot in it, in which the edge is ``faint`` strong."""
    left, right = (WIDTH - gap) / 2, (WIDTH + gap) / 2
    gray = render((80, WIDTH), lambda u, v: np.maximum(
        polygon([(-99, LEVEL), (left, LEVEL), (left, 999), (-99, 999)])(u, v),
        polygon([(right, LEVEL), (999, LEVEL), (999, 999), (right, 999)])(u, v)))
    slot = slice(round(left) + 2, round(right) - 1)
    gray[round(LEVEL):, slot] = np.maximum(gray[round(LEVEL):, slot], 60 + faint)
    return gray


def level(gray: np.ndarray, **parameters: float) -> list[float]:
    """Return the lengths of the arcs along the edge that has a gap."""
    table = find(gray, **parameters).table
    on = np.abs(table['middle'][:, 1] - LEVEL) < 1
    return sorted(table['length'][on])


@pytest.mark.parametrize('max_gap', [10, 20])
@pytest.mark.parametrize('share', [0.3, 0.6, 0.85])
def test_a_gap_is_bridged_up_to_max_gap(max_gap, share):
    length, = level(interrupted(share * max_gap), max_gap=max_gap)
    assert length > WIDTH - 5


@pytest.mark.parametrize('max_gap', [0, 10, 20])
@pytest.mark.parametrize('beyond', [2, 10])
def test_a_gap_is_not_bridged_beyond_max_gap(max_gap, beyond):
    gap = max_gap + beyond
    first, second = level(interrupted(gap), max_gap=max_gap)
    assert first + second < WIDTH - gap + 5


def pieces_joined(gap: float, aside: float, max_gap: float) -> list[int]:
    """Return how many pieces each arc has of two level ones of 60 points, a gap in px apart."""
    x = np.concatenate([np.arange(60.0), 59.0 + gap + np.arange(60.0)]) + 20
    points = np.zeros((4, 120), np.float32)
    points[0], points[1] = x, np.repeat([30, 30 + aside], 60) + 0.02 * (np.arange(120) % 2)
    offsets, runs = np.array([0, 60, 120]), np.empty((20, 2), np.int64)
    fits = np.empty((20, circle.FIT_SIZE))
    limits = Limits(8, 12.0, 15.0, 4.0, 2.4, max_gap, 0.7, *curvature_limits(2.3, 0.01, None))
    count = extraction.extract(points, offsets, limits, np.empty((20, 3), np.int64), runs, fits)
    assert count == 2
    described = pieces.describe(points, runs[:2], fits[:2], pieces.piece_memory(20))
    flat = np.zeros((60, 220), np.int16)
    frame = Frame(flat, flat, region(flat.shape, None), 0.0, 0.6, 3.5, 10.0)
    joined = joining.join(described, joining.Memory(20), frame, limits)
    return np.diff(joined.offsets).tolist()


@hypothesis.given(st.floats(-3.5, 5), st.floats(-0.5, 0.5))
def test_without_a_gap_nothing_is_joined(gap, aside):
    assert pieces_joined(gap, aside, 0.0) == [1, 1]
    assert pieces_joined(gap, aside, 8.0) == [2]


def test_what_lies_in_a_wide_gap_counts():
    # The pieces are 170 px long: 60 px of nothing leave it open whether they belong together.
    settings = {'max_gap': 100, 'contrast_low': 15, 'contrast_high': 20}
    assert len(level(interrupted(60), **settings)) == 2
    assert len(level(interrupted(60, faint=4), **settings)) == 1


@pytest.mark.parametrize('radius', [150, 400])
def test_an_arc_behind_a_post_is_one(radius):
    gray = render((200, 240), disk(119.5, radius + 40, radius))
    gray[:, 110:122] = 200
    arcs = find(gray)
    longest = int(np.argmax(arcs.table['length']))
    points = samples(arcs, longest)
    assert points[:, 0].min() < 12 and points[:, 0].max() > 227
    assert np.abs(off_circle(points, 119.5, radius + 40, radius)).max() < 0.5


@pytest.mark.parametrize('shift', [3.0, 8.0])
def test_pieces_beside_each_other_are_two(shift):
    gray = render((80, WIDTH), lambda u, v: np.where(u < 200, v - LEVEL, v - LEVEL - shift))
    lengths = sorted(find(gray).table['length'])
    assert len(lengths) >= 2 and lengths[-1] < 0.6 * WIDTH


@pytest.mark.parametrize(('length', 'one'), [(60, False), (180, True)])
def test_what_is_short_must_fit_more_closely(length, one):
    # Two pieces 1.8 px beside each other: as bent as that a long edge may be, no short one.
    gray = render((80, 2 * length), lambda u, v: v - LEVEL - np.where(u < length, 0, 1.8))
    gray[:, length - 4:length + 4] = 60
    longest = find(gray).table['length'].max()
    assert (longest > 1.9 * length) == one


@pytest.mark.parametrize('bend', [10, 25])
def test_pieces_in_two_directions_are_two(bend):
    slope = np.tan(np.radians(bend))
    gray = render((160, WIDTH), lambda u, v: v - 40 - np.where(u > 200, (u - 200) * slope, 0))
    gray[:, 195:205] = 60
    lengths = find(gray).table['length']
    assert lengths.max() < 0.65 * WIDTH


def squares(count: int, size: float, x: float, y: float, angle: float):
    """Return a chessboard of count x count squares with its first corner at (x, y)."""
    c, s = np.cos(angle), np.sin(angle)

    def wave(t: np.ndarray) -> np.ndarray:
        return np.where(np.floor(t) % 2 == 0, 1, -1) * (0.5 - np.abs(t % 1 - 0.5)) * size

    def region(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        p, q = (c * (u - x) + s * (v - y)) / size, (c * (v - y) - s * (u - x)) / size
        a, b = wave(p), wave(q)
        inner = np.where(a * b > 0, 1, -1) * np.minimum(np.abs(a), np.abs(b))
        border = size * np.minimum(np.minimum(p, count - p), np.minimum(q, count - q))
        return np.minimum(inner, border)
    return region


@pytest.mark.parametrize('lam', [0.0, -0.4])
@pytest.mark.parametrize('angle', [0.05, 0.25])
def test_the_lines_of_a_chessboard_run_across_its_squares(lam, angle):
    lens = DivisionModel(lam, (300, 400))
    board = squares(8, 35, 100, 10, angle)
    arcs = find(render(lens.shape, through_lens(board, lens)))
    along = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    for direction, across in (along, along[::-1]):
        for k in range(1, 8):
            start = np.array([100, 10]) + 35 * k * across
            heading = np.arctan2(direction[1], direction[0])
            off = [np.abs(off_line(lens.undistort(samples(arcs, i)), *start, heading)).max()
                   for i in range(len(arcs))]
            best = int(np.argmin(off))
            assert off[best] < 1
            ends = lens.undistort(samples(arcs, best)[[0, -1]])
            assert np.hypot(*(ends[1] - ends[0])) > 0.9 * 8 * 35 or _leaves(lens, start, direction)
            assert arcs.table['polarity'][best] < 0.2


def _leaves(lens: DivisionModel, start: np.ndarray, direction: np.ndarray) -> bool:
    """Return whether a line of the board is not wholly inside the image."""
    ends = lens.distort(start + np.outer([0, 8 * 35], direction))
    height, width = lens.shape
    return bool(((ends < 3) | (ends > (width - 4, height - 4))).any())


def test_joined_arcs_are_described_as_one():
    gray = interrupted(12)
    arcs = find(gray)
    on = int(np.argmax(arcs.table['length']))
    whole, row = arcs.points(on), arcs.table[on]
    assert row['support'] == len(whole) > 370
    assert (np.diff(whole[:, 0]) * np.sign(whole[-1, 0] - whole[0, 0]) > 0).all()
    assert not ((whole[:, 0] > 196) & (whole[:, 0] < 203)).any()
    assert row['polarity'] == 1


def test_a_plain_edge_is_one_arc_without_joining_too():
    assert only(find(render((80, WIDTH), lambda u, v: v - LEVEL), max_gap=0))['length'] > 395


def hidden(lens: DivisionModel, shown: float) -> np.ndarray:
    """
    Return the picture of an edge, 280 px of it, 40 px more, and a gap of 50 px in between.

    It shows faintly over that share of the gap.
    """
    straight = through_lens(half_plane(0, 60.3, 0.0), lens)
    gray, faint = render(lens.shape, straight), render(lens.shape, straight, 60, 64)
    half = round(25 * shown)
    gray[:, 280:330] = gray[:, 370:] = 60
    gray[:, 305 - half:305 + half] = faint[:, 305 - half:305 + half]
    return gray


@pytest.mark.parametrize('lam', [-0.6, -0.3, 0.0, 0.2])
@pytest.mark.parametrize(('shown', 'usual', 'known'), [
    (0.0, 2, 2), (0.36, 2, 1), (0.8, 1, 1)])
def test_a_known_lens_reaches_over_gaps_that_show_less(lam, shown, usual, known):
    lens = DivisionModel(lam, (240, WIDTH))
    gray = hidden(lens, shown)
    for model, count in ((None, usual), (lens, known)):
        table = find(gray, model, max_gap=100, contrast_low=15, contrast_high=20).table
        assert np.count_nonzero(np.abs(table['end'] - table['start'])[:, 0] > 20) == count


def bent(lens: DivisionModel, degrees: float) -> np.ndarray:
    """Return the picture of two edges that meet at an angle, with a post before their corner."""
    half = np.radians(degrees) / 2
    gray = render(lens.shape, through_lens(
        both(half_plane(150, 60.3, -half), half_plane(150, 60.3, half)), lens))
    gray[:, 143:157] = 60
    return gray


@pytest.mark.parametrize('lam', [-0.4, 0.0])
@pytest.mark.parametrize(('degrees', 'usual', 'known'), [(0.0, 1, 1), (4.5, 1, 2), (10.0, 2, 2)])
def test_a_known_lens_parts_edges_that_only_look_like_one(lam, degrees, usual, known):
    lens = DivisionModel(lam, (240, 300))
    gray = bent(lens, degrees)
    for model, count in ((None, usual), (lens, known)):
        table = find(gray, model).table
        across = table[np.abs(table['end'] - table['start'])[:, 0] > 100]
        assert len(across) == count
        assert across['length'].sum() > 275


@pytest.mark.parametrize('lam', [-0.5, 0.0, 0.2])
@pytest.mark.parametrize('radius', [75, 95])
def test_a_wheel_is_no_picture_of_a_straight_edge(lam, radius):
    gray = render((240, 320), disk(140.2, 118.7, radius))
    gray[:, 130:138] = 60
    usual, known = find(gray), find(gray, DivisionModel(lam, gray.shape))
    for arcs in (usual, known):
        table = arcs.table
        on = table[np.abs(off_circle(table['middle'], 140.2, 118.7, radius)) < 0.3]
        assert np.allclose(1 / np.abs(on['curvature']), radius, rtol=0.01)
        assert on['length'].max() > 2.3 * radius
        assert on['length'].sum() > 2 * np.pi * radius - 60
    # Hypotheses are pictures of straight edges then, of which a small wheel has short ones only.
    assert len(known) <= len(usual) + 1


@pytest.mark.parametrize('lam', [-0.4, 0.0])
def test_a_round_edge_behind_a_post_is_one_with_a_known_lens(lam):
    gray = render((200, 240), disk(119.5, 190, 150))
    gray[:, 110:122] = 200
    arcs = find(gray, DivisionModel(lam, gray.shape))
    points = samples(arcs, int(np.argmax(arcs.table['length'])))
    assert points[:, 0].min() < 12 and points[:, 0].max() > 227
    assert np.abs(off_circle(points, 119.5, 190, 150)).max() < 0.5
