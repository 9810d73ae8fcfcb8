"""Identities are judged by where lines of one frame are in another."""
from __future__ import annotations

from benchmark.identity import compare, Lives, lives, over_frames, Sums
from benchmark.metrics import Samples
from benchmark.trackers import Tracked
import numpy as np
import pytest

MOVE = np.array([3.0, 1.0])     # px a frame


class Moving:
    """All points move alike; those beyond x = 200 are not in sight."""

    def carry(self, pieces: Samples, i: int, j: int) -> np.ndarray:
        """Add the motion."""
        there = pieces.points + (j - i) * MOVE
        return np.where(there[:, :1] < 200.0, there, np.nan)


def frame(i: int, ids: list[int]) -> Tracked:
    """Return level lines of 100 px and 30 px apart."""
    lines = [np.array([[10.0, y], [110, y]]) + i * MOVE for y in 20 + 30 * np.arange(len(ids))]
    return Tracked(lines, np.array(ids))


@pytest.mark.parametrize(('later', 'found', 'kept', 'right'), [
    ([1, 2, 3], 1, 1, 1), ([1, 2, 9], 1, 2 / 3, 1), ([1, 2], 2 / 3, 1, 1),
    ([1, 3, 2], 1, 1 / 3, 1 / 3)])
def test_figures(later, found, kept, right):
    """A line may be missing, have a new identity, or that of another line."""
    sums = compare(Moving(), frame(0, [1, 2, 3]), frame(2, later), 0, 2)
    assert sums.figures == pytest.approx((found, kept, right))


def test_lines_out_of_sight_do_not_count():
    here = Tracked([np.array([[150.0, 20], [199, 20]]), np.array([[10.0, 50], [110, 50]])],
                   np.array([1, 2]))
    assert compare(Moving(), here, frame(10, [1, 2]), 0, 10).sight == pytest.approx(100, abs=2)


def test_a_frame_without_lines():
    empty = Tracked([], np.zeros(0, int))
    assert compare(Moving(), empty, frame(1, [1]), 0, 1) == Sums()
    assert compare(Moving(), frame(0, [1]), empty, 0, 1).figures[0] == 0


def test_all_lags_of_a_sequence():
    found = [frame(0, [1, 2]) for _ in range(12)]
    sums = over_frames(type('Still', (), {'carry': lambda _, pieces, i, j: pieces.points})(),
                       found)
    assert sums[10].figures == (1, 1, 1)
    assert np.isnan(sums[30].figures[0])


def test_lives():
    """One identity lasts six frames, one two; in one frame an identity is there twice."""
    found = [frame(0, [1, 2]), frame(0, [1, 2]), *4 * [frame(0, [1])]]
    assert lives(found) == Lives(2, 8, 6, 0, 6)
    assert lives([frame(0, [1, 1, 2])]).twice == 1
