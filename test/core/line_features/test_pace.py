"""Frames at a lower rate than that of the camera, by their stamps."""
from __future__ import annotations

import numpy as np
import pytest
from qflsd_ros.core.line_features.pace import Pace

START = 1_700_000_000_000_000_000


def passed(stamps: np.ndarray | list[int], rate: float, pace: Pace | None = None) -> list[int]:
    pace = pace or Pace()
    return [number for number, stamp in enumerate(stamps) if pace.due(int(stamp), rate)]


def regular(rate: float, count: int, jitter: float = 0.0) -> np.ndarray:
    """Return stamps at a rate, with jitter in periods."""
    noise = np.random.default_rng(1).uniform(-jitter, jitter, count)
    return START + ((np.arange(count) + noise) / rate * 1e9).astype(np.int64)


@pytest.mark.parametrize(('camera', 'rate', 'step'), [
    (30, 10, 3), (20, 10, 2), (10, 10, 1), (60, 10, 6), (29.97, 9.99, 3), (5, 10, 1)])
@pytest.mark.parametrize('jitter', [0.0, 0.15])
def test_every_kth_frame_in_step(camera, rate, step, jitter):
    assert passed(regular(camera, 300, jitter), rate) == list(range(0, 300, step))


def test_other_rates_are_met_on_average():
    numbers = passed(regular(25, 1000), 10)
    assert len(numbers) == pytest.approx(400, abs=2)
    assert set(np.diff(numbers)) == {2, 3}


def test_rate_0_takes_every_frame():
    assert passed([5, 5, 3, 900], 0) == [0, 1, 2, 3]


def test_stamps_that_do_not_advance_pass():
    """A driver without stamps is not silenced, and a recording may begin again."""
    assert passed([0] * 5, 10) == [0, 1, 2, 3, 4]
    stamps = np.r_[regular(30, 9), regular(30, 9)]
    assert passed(stamps, 10) == [0, 3, 6, 9, 12, 15]


def test_after_a_gap_the_times_begin_anew():
    stamps = np.r_[regular(30, 6), regular(30, 6) + 10**9 + 7_000_000]
    assert passed(stamps, 10) == [0, 3, 6, 9]


def test_frames_that_are_lost_do_not_shift_the_others():
    numbers = [number for number in range(30) if number not in (4, 6, 14)]
    found = [numbers[k] for k in passed(regular(30, 30)[numbers], 10)]
    assert found[:2] == [0, 3] and found[-4:] == [18, 21, 24, 27]


def test_another_rate_begins_at_once():
    pace, stamps = Pace(), regular(30, 30)
    assert passed(stamps[:10], 10, pace) == [0, 3, 6, 9]
    assert passed(stamps[10:16], 30, pace) == [0, 1, 2, 3, 4, 5]
    assert passed(stamps[16:], 5, pace) == [0, 6, 12]
