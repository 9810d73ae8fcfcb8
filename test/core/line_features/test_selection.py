"""The choice of lines is balanced, the same every time, and changes little."""
from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from qflsd_ros.core.line_features.selection import balanced, Candidates, groups, SETTLED


def candidates(group: list[int], **columns: list[int] | list[bool]) -> Candidates:
    """Return candidates that are equal but for their group and the given columns."""
    count = len(group)
    given_or = {'chosen': np.zeros(count, bool), 'ages': np.full(count, 50),
                'lengths': np.full(count, 40.0), 'tracks': np.arange(1, count + 1)}
    given_or |= {name: np.array(values) for name, values in columns.items()}
    return Candidates(np.array(group, np.int64), **given_or)


def test_groups_are_quarters_and_orientations():
    starts = np.array([[10.0, 10], [600, 10], [10, 400], [600, 400], [10, 10]])
    ends = starts + [[20, 5], [-20, -5], [5, 20], [5, -20], [21, 20]]
    assert groups(starts, ends, (480, 640)).tolist() == [0, 2, 5, 7, 0]


def test_all_are_chosen_while_there_are_few():
    assert balanced(candidates([0, 0, 5]), 3).tolist() == [0, 1, 2]
    assert balanced(candidates([]), 3).tolist() == []


def test_groups_take_turns():
    found = balanced(candidates([0] * 100 + [1] * 3 + [6] * 20), 23)
    assert np.bincount(found // 1 < 100).tolist() == [13, 10]
    assert (found >= 103).sum() == 10 and ((found >= 100) & (found < 103)).sum() == 3


def test_long_tracks_come_first_then_long_lines():
    lines = candidates([0] * 4, ages=[9, 30, 9, 9], lengths=[50, 40, 90, 50])
    assert balanced(lines, 1).tolist() == [1]
    assert balanced(lines, 2).tolist() == [1, 2]
    assert balanced(lines, 3).tolist() == [0, 1, 2]


def test_what_was_chosen_stays_before_older_ones_of_its_group():
    lines = candidates([0] * 3, chosen=[False, True, False], ages=[90, 10, 80])
    assert balanced(lines, 1).tolist() == [1]


def test_young_lines_fill_free_places_only():
    old = [True] * 4 + [False]
    for age, found in ((SETTLED - 1, [0, 1, 2, 3]), (SETTLED, [0, 1, 2, 4])):
        lines = candidates([0, 0, 0, 0, 3], chosen=old, ages=[50, 50, 50, 40, age])
        assert balanced(lines, 4).tolist() == found
    assert balanced(lines, 5).tolist() == [0, 1, 2, 3, 4]


@given(st.lists(st.tuples(st.integers(0, 7), st.booleans(), st.integers(1, 9),
                          st.integers(30, 33)), max_size=40), st.integers(1, 20))
def test_the_order_of_the_lines_does_not_matter(rows, most):
    columns = [list(column) for column in zip(*rows)] or [[], [], [], []]
    tracks = np.arange(len(rows))
    lines = Candidates(np.array(columns[0], np.int64), np.array(columns[1], bool),
                       np.array(columns[2]), np.array(columns[3]), tracks)
    found = balanced(lines, most)
    assert len(found) == min(most, len(rows)) and (np.diff(found) > 0).all()
    mixed = np.random.default_rng(len(rows)).permutation(len(rows))
    other = balanced(Candidates(*(column[mixed] for column in lines)), most)
    assert sorted(tracks[mixed][other].tolist()) == tracks[found].tolist()
    # Again with the same lines, all of them stay.
    again = balanced(lines._replace(chosen=np.isin(tracks, found)), most)
    settled = ~lines.chosen & (lines.ages < SETTLED)
    if not settled.any():
        assert again.tolist() == found.tolist()
