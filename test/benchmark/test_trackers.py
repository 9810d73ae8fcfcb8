"""Every tracker gives lines that move the identities that they had."""
from __future__ import annotations

from benchmark import trackers
from benchmark.scenes.return_walk import ReturnWalk
import numpy as np
import pytest


@pytest.mark.parametrize('name', trackers.available())
def test_identities_go_on(name):
    """In a slow walk most lines have an identity of the frame before, none has it twice."""
    walk, tracker = ReturnWalk((240, 320), 0.0, 4, 0), trackers.begin(name)
    first, second = tracker(walk.frame(0)), tracker(walk.frame(1))
    assert len(first.lines) == len(first.ids) > 20
    for frame in first, second:
        assert len(np.unique(frame.ids)) == len(frame.ids)
    assert np.isin(second.ids, first.ids).mean() > 0.5


@pytest.mark.parametrize('name', trackers.available())
def test_a_frame_without_lines(name):
    tracker = trackers.begin(name)
    for _ in range(2):
        found = tracker(np.full((240, 320), 90, np.uint8))
        assert len(found.lines) == len(found.ids) == 0
    assert len(tracker(ReturnWalk((240, 320), 0.0, 1, 0).frame(0)).ids) > 20


def test_every_tracker_has_a_title():
    assert len({trackers.title(name) for name in trackers.available()}) == len(
        trackers.available())
