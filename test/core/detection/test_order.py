"""Pieces and arcs in order of their length."""
from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
from qflsd_ros.core.detection import order


@given(arrays(float, st.integers(0, 60), elements=st.floats(0, 1e5)), st.randoms())
def test_those_wanted_are_given_longest_first(lengths, random):
    wanted = np.array([random.random() < 0.7 for _ in lengths], bool)
    given_back = order.longest_first(lengths, wanted)
    assert sorted(given_back) == np.flatnonzero(wanted).tolist()
    assert (np.diff(lengths[given_back]) <= 1 / order.GRAIN).all()


def test_of_equal_lengths_the_first_comes_first():
    assert order.longest_first(np.full(5, 7.3), np.ones(5, bool)).tolist() == [0, 1, 2, 3, 4]
