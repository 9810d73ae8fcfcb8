"""The demo waits for its first result as long as the detector reports progress."""
from __future__ import annotations

import itertools
import os

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import pytest
from qflsd_ros.cli import demo
from qflsd_ros.cli.observer import Observer
from qflsd_ros.cli.processes import Processes
import rclpy
from rclpy.executors import SingleThreadedExecutor

REPORTS = 12
PERIOD = 0.5    # s, several in PATIENCE and all of them beyond it
PATIENCE = 3.0  # s


def test_patience_counts_from_the_last_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slow machine compiles for longer than that in all; without progress it fails."""
    monkeypatch.setenv('ROS_DOMAIN_ID', str(demo.free_domain()))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    monkeypatch.setattr(demo, 'PATIENCE', PATIENCE)
    assert os.environ['ROS_DOMAIN_ID'] != '0'
    rclpy.init(args=[])
    try:
        observer, executor = Observer([]), SingleThreadedExecutor()
        executor.add_node(observer)
        reports = observer.create_publisher(DiagnosticArray, '/diagnostics', 5)
        numbers = itertools.count(1)

        def report() -> None:
            number = min(next(numbers), REPORTS)
            reports.publish(DiagnosticArray(status=[DiagnosticStatus(
                message=f'compiling kernels: {number} of {REPORTS}')]))
        observer.create_timer(PERIOD, report)
        with Processes({'camera': ('sleep', '100')}) as processes, pytest.raises(
                demo.DemoError, match=f'last report: compiling kernels: {REPORTS} of {REPORTS}'):
            demo.await_result(executor, observer, processes, lambda: None)
    finally:
        rclpy.shutdown()
