"""What the statistics of the frames say in a report."""
from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticStatus
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


def test_no_frame_is_a_warning_only_where_somebody_listens() -> None:
    assert report(Statistics())[0].level == DiagnosticStatus.WARN
    assert report(Statistics(), listening=False)[0].level == DiagnosticStatus.OK


def test_late_frames() -> None:
    for age, level in ((0.6, DiagnosticStatus.WARN), (0.4, DiagnosticStatus.OK)):
        statistics = Statistics()
        statistics.arrived()
        statistics.done(0.01, age, 0)
        assert report(statistics)[0].level == level
