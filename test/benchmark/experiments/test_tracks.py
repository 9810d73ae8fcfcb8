"""The table of tracks has a row for each sequence and tracker; the section is in test_main.py."""
from __future__ import annotations

from benchmark.experiments.tracks import follow, Task
from benchmark.scenes.turning import Turning
from benchmark.trackers import TRACKER
import numpy as np


def test_a_camera_that_stands_still_keeps_all_lines():
    """Bars, seen by a camera that does not turn, in fresh noise."""
    gray = np.full((240, 320), 60, np.uint8)
    for x in range(40, 300, 60):
        gray[:, x:x + 30] = 180
    found = follow(Task(TRACKER, 'bars', Turning(gray, 0.0, 12, 0.0)))
    assert min(found.by_lag[1].figures) > 0.99
    assert min(found.by_lag[10].figures) > 0.99
    assert found.lives.twice == 0
