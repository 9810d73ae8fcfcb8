"""Labels stay with their tracks, unless another direction is clearly more likely."""
from __future__ import annotations

from dataclasses import replace

from manhattan import SHAPE
import numpy as np
import pytest
from qflsd_ros.core import Arcs, AttitudeTracker, Tracker
from qflsd_ros.core.arcs import TABLE, TRACKED_TABLE
from qflsd_ros.core.attitude.labels import MEMORY, TrackLabels
from qflsd_ros.core.lens.tracker import LensTracker
from qflsd_ros.sources import Scene


def tracks(*numbers: int) -> Arcs:
    table = np.zeros(len(numbers), TRACKED_TABLE)
    table['track'] = numbers
    return replace(Arcs.empty(), table=table, offsets=np.zeros(len(numbers) + 1, np.int64))


def without_tracks(arcs: Arcs) -> Arcs:
    table = np.zeros(len(arcs), TABLE)
    for name in TABLE.names:
        table[name] = arcs.table[name]
    return replace(arcs, table=table)


def row(label: int, probability: float, count: int = 3) -> list[float]:
    """Return probabilities with one label, and the next one as likely as can be."""
    found = [0.0] * count
    found[label], found[(label + 1) % count] = probability, 0.95 - probability
    return found


def test_a_track_between_two_directions_keeps_the_first() -> None:
    labels, seen = TrackLabels(), []
    for frame in range(40):
        chances = np.array([row(0, 0.55 if frame % 3 else 0.25), row(2, 0.9)])
        seen.append(labels.follow(tracks(7, 9), chances, 3).tolist())
    assert seen == [seen[0]] * 40
    assert seen[0][1] == 2


def test_a_clear_change_is_followed_soon() -> None:
    labels = TrackLabels()
    for _ in range(3 * MEMORY):
        assert labels.follow(tracks(7), np.array([row(0, 0.9)]), 3) == [0]
    after = [int(labels.follow(tracks(7), np.array([row(1, 0.93)]), 3)[0])
             for _ in range(3 * MEMORY)]
    assert after[0] == 0 and after[-1] == 1
    assert after.index(1) < 2 * MEMORY


def test_none_is_a_label_too() -> None:
    labels = TrackLabels()
    assert labels.follow(tracks(7), np.array([[0.1, 0.1, 0.1]]), 3) == [-1]
    assert labels.follow(tracks(7), np.array([[0.6, 0.1, 0.1]]), 3) == [-1]
    for _ in range(2 * MEMORY):
        found = labels.follow(tracks(7), np.array([[0.95, 0.0, 0.0]]), 3)
    assert found == [0]


def test_order_and_new_tracks() -> None:
    labels = TrackLabels()
    labels.follow(tracks(4, 2), np.array([row(0, 0.9), row(1, 0.9)]), 3)
    found = labels.follow(tracks(2, 8, 4), np.array([[0.4, 0.3, 0.3]] * 3), 3)
    assert found.tolist() == [1, -1, 0]


def test_other_further_directions_are_labelled_anew() -> None:
    labels = TrackLabels()
    labels.follow(tracks(1, 2), np.array([row(3, 0.9, 5), row(0, 0.9, 5)]), 3)
    found = labels.follow(tracks(1, 2), np.array([[0, 0, 0, 0.3, 0.6], [0.3, 0.6, 0, 0, 0]]), 3)
    assert found.tolist() == [4, 0]
    found = labels.follow(tracks(1, 2), np.array([[0, 0, 0, 0.6, 0.4], [0.9, 0, 0, 0, 0]]), 5)
    assert found.tolist() == [4, 0]


def test_without_tracks_each_frame_counts_by_itself() -> None:
    labels, arcs = TrackLabels(), without_tracks(tracks(7))
    for label in 0, 1, 2, 0:
        assert labels.follow(arcs, np.array([row(label, 0.55)]), 3) == [label]


@pytest.mark.parametrize('lam', [-0.3, -0.6])
def test_labels_of_the_rendered_room_do_not_flicker(lam: float) -> None:
    scene, tracker, lenses = Scene(640, 480, lam, 2.0), Tracker(), LensTracker()
    attitudes, single, before = AttitudeTracker(), AttitudeTracker(), {}
    changed = alone = count = 0
    for number in range(600, 640):
        arcs = tracker.track(scene.image(number))
        lenses.add(arcs, SHAPE)
        labels = attitudes.add(arcs, SHAPE, lenses.estimate).labels
        others = single.add(without_tracks(arcs), SHAPE, lenses.estimate).labels
        now = dict(zip(arcs.table['track'].tolist(), zip(labels.tolist(), others.tolist())))
        for name in now.keys() & before.keys():
            changed += now[name][0] != before[name][0]
            alone += now[name][1] != before[name][1]
            count += 1
        before = now
        assert np.mean([label == other for label, other in now.values()]) > 0.8
    assert count > 2000
    assert changed < 0.005 * count < alone
