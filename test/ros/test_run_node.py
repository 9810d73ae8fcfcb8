"""From the first moment of a process to its exit code."""
from __future__ import annotations

from pathlib import Path
import signal
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from conftest import Peer


@pytest.mark.parametrize('node', ['camera', 'detector'])
@pytest.mark.parametrize('library', ['numpy', 'cv2', 'librcl.so'])
def test_an_interrupt_in_the_first_second(peer: Peer, node: str, library: str) -> None:
    """While the node is still importing what it needs, Ctrl-C ends it without a traceback."""
    process = peer.run('-m', 'qflsd_ros.ros', node)
    maps = Path(f'/proc/{process.popen.pid}/maps')
    peer.until(lambda: library in maps.read_text(), period=0.001)
    assert process.stop() in (0, -signal.SIGINT)
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
