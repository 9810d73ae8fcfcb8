"""The report on tracks counts those that begin and end."""
from __future__ import annotations

from dataclasses import replace

import numpy as np
from qflsd_ros.core.arcs import Arcs, TRACKED_TABLE
from qflsd_ros.ros.tracks import TrackStatistics


def frame(ages: dict[int, int]) -> Arcs:
    """Return arcs with the age of each track."""
    table = np.zeros(len(ages), TRACKED_TABLE)
    table['track'], table['age'] = list(ages), list(ages.values())
    return replace(Arcs.empty(), table=table)


def test_new_lost_alive_and_their_age() -> None:
    now = 0.0
    statistics = TrackStatistics(lambda: now)
    for ages in ({1: 1, 2: 1, 3: 1}, {1: 2, 3: 2, 4: 1}, {1: 3, 4: 2}, {1: 4, 4: 3, 3: 3}):
        statistics.follow(frame(ages))
    now = 2.0
    assert statistics.take() == {'tracks': '3', 'track age median (frames)': '3',
                                 'tracks new (1/s)': '2.0', 'tracks lost (1/s)': '1.0'}
    now = 3.0
    assert statistics.take()['tracks new (1/s)'] == '0.0'


def test_without_tracking_nothing_is_said_and_nothing_lost() -> None:
    statistics = TrackStatistics(lambda: 0.0)
    assert statistics.take() == {}
    statistics.follow(frame({1: 1}))
    statistics.follow(Arcs.empty())
    assert statistics.take() == {}
    statistics.follow(frame({}))
    found = statistics.take()
    assert found['tracks'] == '0' and found['track age median (frames)'] == 'nan'
    assert found['tracks lost (1/s)'] == '0.0'
