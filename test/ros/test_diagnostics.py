"""The report of the statistics of frames."""
from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import pytest
from qflsd_ros.ros.diagnostics import Statistics


def report(statistics: Statistics, listening: bool = True,
           max_age: float = 0.5) -> tuple[DiagnosticStatus, dict[str, str]]:
    status = DiagnosticStatus()
    statistics.report(status, listening, max_age)
    return status, {item.key: item.value for item in status.values}


def test_all_is_well() -> None:
    statistics = Statistics()
    statistics.arrived()
    statistics.done(0.010, 0.020, 7)
    status, values = report(statistics)
    assert status.level == DiagnosticStatus.OK and status.message == 'detecting'
    assert values['frames'] == '1' and values['arcs per frame'] == '7.0'
    assert values['latency median (ms)'] == '10.0' and values['age median (ms)'] == '20.0'


@pytest.mark.parametrize('happen, words, key', [
    (lambda statistics: statistics.lost(3), '3 frames lost', 'frames lost'),
    (lambda statistics: [statistics.dropped() for _ in range(3)], '3 of 1', 'frames dropped'),
    (lambda statistics: [statistics.bad('data too short') for _ in range(3)],
     '3 bad frames (data too short)', 'frames bad'),
])
def test_every_loss_is_told_once_and_stays_counted(happen, words, key) -> None:
    statistics = Statistics()
    statistics.arrived()
    happen(statistics)
    status, values = report(statistics)
    assert status.level == DiagnosticStatus.WARN and words in status.message
    assert values[key] == '3'
    statistics.arrived()
    status, values = report(statistics)
    assert status.level == DiagnosticStatus.OK and values[key] == '3'


class Hours:
    """A clock that the test advances, with a report at every full second."""

    def __init__(self) -> None:
        self.now = 0.0
        self.statistics = Statistics(lambda: self.now)

    def messages(self, seconds: int, rate: float, listening: bool = True) -> list[str]:
        """Let seconds go by with frames at a rate; return what the reports say."""
        arrivals = iter(np.arange(self.now, self.now + seconds, 1 / rate) if rate else [])
        arrival = next(arrivals, np.inf)
        messages = []
        for second in self.now + 1 + np.arange(seconds):
            while arrival < second:
                self.now = arrival
                self.statistics.arrived()
                arrival = next(arrivals, np.inf)
            self.now = second
            messages.append(report(self.statistics, listening)[0].message)
        return messages


def test_no_frame_is_a_warning_only_where_somebody_listens() -> None:
    hours = Hours()
    assert set(hours.messages(60, 0, listening=False)) == {'nobody listens'}
    # The camera gets a moment, then silence is told for as long as it lasts.
    messages = hours.messages(60, 0)
    assert messages[:2] == ['detecting'] * 2
    assert messages[2:] == [f'no frame came in for {second}.0 s' for second in range(3, 61)]
    assert set(hours.messages(60, 0, listening=False)) == {'nobody listens'}


@pytest.mark.parametrize('rate', [0.1, 0.3, 0.8, 0.99, 5.0, 30.0])
def test_a_slow_camera_is_no_reason_to_warn_and_one_that_stops_is(rate: float) -> None:
    hours = Hours()
    assert set(hours.messages(200, rate)[int(1 / rate):][20:]) == {'detecting'}
    silent = hours.messages(40, 0)
    assert 'no frame came in' in silent[int(3 / rate + 2)]
    # It may have been away for long: then it is the camera that it was before.
    hours.messages(1000, 0)
    assert set(hours.messages(100, rate)[20:]) == {'detecting'}
    assert 'no frame came in' in hours.messages(40, 0)[int(3 / rate + 2)]


def test_late_frames() -> None:
    for age, level in ((0.6, DiagnosticStatus.WARN), (0.4, DiagnosticStatus.OK)):
        statistics = Statistics()
        statistics.arrived()
        statistics.done(0.01, age, 0)
        assert report(statistics)[0].level == level
