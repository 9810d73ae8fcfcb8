"""From the first moment of a process to its exit code."""
from __future__ import annotations

from pathlib import Path
import signal
import time
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from conftest import Peer


@pytest.mark.parametrize('node, number', [
    ('camera', signal.SIGINT), ('detector', signal.SIGTERM)])
@pytest.mark.parametrize('library', ['numpy', 'cv2', 'librcl.so'])
def test_a_signal_in_the_first_second(peer: Peer, number: int, node: str, library: str) -> None:
    """While the node is still importing what it needs, exit code 0 and no traceback as well."""
    process = peer.run('-m', 'qflsd_ros.ros', node)
    maps = Path(f'/proc/{process.popen.pid}/maps')
    peer.until(lambda: library in maps.read_text(), period=0.001)
    assert process.stop(number) == 0
    assert process.output == ''


DEAF = """
import sys
from rclpy import executors
from rclpy.guard_condition import GuardCondition
executors.SignalHandlerGuardCondition = lambda context: GuardCondition(None, None, context=context)
from qflsd_ros.ros.__main__ import main
sys.exit(main())
"""


@pytest.mark.parametrize('node', ['camera', 'detector'])
def test_a_signal_that_rclpy_misses(peer: Peer, node: str) -> None:
    """A wait that no signal ends, as between two waits, is over soon."""
    process = peer.run('-c', DEAF, node)
    peer.until(lambda: node in peer.node.get_node_names())
    begin = time.monotonic()
    peer.until(lambda: time.monotonic() > begin + 2.0)  # it waits for a listener by now
    assert process.stop() == 0
    assert process.output == ''


@pytest.mark.parametrize('node, parameter, texts', [
    ('detector', 'tolerance: wide', ["parameter tolerance is 'wide'", 'must be of type float']),
    ('detector', 'use_sim_time: 7', ['use_sim_time']),
    ('camera', 'rate: 0', ['parameter rate is 0', 'must lie in 0.01 to 1000.0 Hz'])])
def test_a_bad_value_in_a_file_is_named_with_its_line(peer: Peer, node: str, parameter: str,
                                                      texts: list[str]) -> None:
    file = peer.folder / 'bad.yaml'
    file.write_text(f'/**:\n  ros__parameters:\n    # a comment\n    {parameter}\n')
    process = peer.run('-m', 'qflsd_ros.ros', node, '--ros-args', '--params-file', str(file))
    assert process.wait() == 2
    line, = process.output.splitlines()
    assert line.startswith(f'{node}: ') and line.endswith(f'({file}, line 4)')
    assert all(text in line for text in texts), line


@pytest.mark.parametrize('name', ['camera', 'detector', 'detectors', 'demo'])
def test_without_ros_it_says_so_in_one_line(peer: Peer, name: str) -> None:
    """As after ``pip install .`` alone."""
    for package in ('rclpy', 'sensor_msgs', 'std_msgs', 'diagnostic_msgs', 'builtin_interfaces'):
        (peer.folder / f'{package}.py').write_text(
            f'raise ModuleNotFoundError("No module named {package}", name="{package}")')
    process = peer.run('-c', f'import sys; from qflsd_ros.ros import __main__ as nodes; '
                       f'sys.exit(nodes.{name}())', PYTHONPATH=str(peer.folder))
    assert process.wait() == 2
    line, = process.output.splitlines()
    assert line.startswith(f'{name}: the Python module ') and 'source ROS 2 Jazzy' in line


@pytest.mark.parametrize('arguments', [(), ('nodes',), ('--help',)])
def test_which_node_is_to_be_named(peer: Peer, arguments: tuple[str, ...]) -> None:
    process = peer.run('-m', 'qflsd_ros.ros', *arguments)
    assert process.wait() == 2
    assert process.output.splitlines() == [
        'usage: python3 -m qflsd_ros.ros camera|detector|detectors [--ros-args ...]']
