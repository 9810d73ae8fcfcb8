"""Machines with defects: full shared memory, a read-only home, a bad network."""
from __future__ import annotations

import json
import os
from pathlib import Path
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from rig import Rig

if TYPE_CHECKING:
    from conftest import Peer

ROOT = Path(__file__).parents[2]
ORDINARY = ('test_segments_are_those_of_the_core', 'test_bad_frames_are_counted_by_reason')


def namespace(flags: str, script: str, timeout: float = 200.0) -> str:
    """Run a shell script in new Linux namespaces; return its output, or skip the test."""
    if not shutil.which('unshare'):
        pytest.skip('there is no command unshare (package util-linux)')
    probe = subprocess.run(['unshare', flags, 'true'], capture_output=True, text=True)
    if probe.returncode:
        pytest.skip(f'this kernel gives an ordinary user no namespaces: {probe.stderr.strip()}')
    result = subprocess.run(['unshare', flags, 'sh', '-ec', script], cwd=ROOT, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=timeout)
    assert result.returncode == 0, result.stdout
    return result.stdout


def test_a_full_shared_memory() -> None:
    """DDS then uses UDP, and the detector works, with 64 KiB of shared memory."""
    tests = ' '.join(f'test/ros/test_detector_node.py::{name}' for name in ORDINARY)
    said = namespace('-Urm', 'mount -t tmpfs -o size=64k tmpfs /dev/shm; '
                     'head -c 30000 /dev/zero > /dev/shm/full || true; '
                     f'exec {sys.executable} -m pytest -q -p no:cacheprovider {tests}')
    assert f'{len(ORDINARY)} passed' in said


def test_a_home_that_cannot_be_written(peer: Peer) -> None:
    """
    The node compiles at every start, and logs once how to avoid that.

    That what is compiled works without being kept is shown by test/core/kernels/test_store.py.
    """
    cache = peer.folder / 'cache'
    cache.write_text('a file where a folder should be')  # root may write into any folder
    rig = Rig(peer, HOME='/proc', XDG_CACHE_HOME=str(cache))
    first, later = (rig.report('compiling kernels: ').message for _ in range(2))
    assert int(later.split()[2]) >= int(first.split()[2])
    assert 'compiling kernels: ' in rig.process.output and 'not kept' in rig.process.output
    line, = (line for line in rig.process.output.splitlines() if 'NUMBA_CACHE_DIR' in line)
    assert 'compiled code cannot be kept in' in line and str(cache) in line
    assert 'every start compiles anew' in line and 'Traceback' not in rig.process.output
    assert rig.process.stop() == 0


def test_no_place_for_logs_is_said_in_one_line(peer: Peer) -> None:
    environment = {'ROS_LOG_DIR': '', 'ROS_HOME': ''}
    process = peer.run('-m', 'qflsd_ros.ros', 'detector', HOME='/proc', **environment)
    assert process.wait() == 2
    line = process.output.splitlines()[-1]
    assert line.startswith('detector: ') and 'log directory' in line
    assert line.endswith('set ROS_LOG_DIR to a writable folder')
    assert 'Traceback' not in process.output and os.listdir(peer.folder)


@pytest.mark.alone
def test_two_hosts_and_a_bad_cable_between_them(tmp_path: Path) -> None:
    """With 50 ms of delay, 5 % of loss and a cut of 10 s, the detector recovers by itself."""
    environment = (f'cd {tmp_path}; export PYTHONPATH={ROOT} ROS_LOG_DIR={tmp_path} '
                   'ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET '
                   'FASTDDS_BUILTIN_TRANSPORTS=UDPv4; ')  # they share a memory, as hosts do not
    here = ROOT / 'test' / 'ros'
    said = namespace('-Urn', f'{environment} exec {sys.executable} {here}/hosts.py '
                     f'"{sys.executable} -m qflsd_ros.ros detector" '
                     f'"{sys.executable} {here}/far_camera.py"')
    before, late, cut, after, last = (
        json.loads(line) for line in said.splitlines() if line.startswith('{'))
    assert before['results'] >= 20
    assert cut['results'] == 0 and cut['newest'] <= late['sent']
    # Afterwards new frames come through again, as many as before.
    assert after['results'] >= 60 and after['newest'] > cut['sent']
    assert last['results'] > 30
    # Frames that the cable swallowed are counted: all of the cut, and one in twenty besides.
    counts = {key: int(value) for key, value in last['counts'].items()
              if key.startswith('frames')}
    assert counts['frames lost'] > 150 and counts['frames'] >= 60
    assert 'frames bad: internal error' not in counts and 'Traceback' not in said
    arrived = counts['frames'] + counts['frames dropped'] + counts['frames bad']
    # Through such a cable the newest counts come late, and none is ever too high.
    assert 0.6 * (last['sent'] - last['first']) < arrived + counts['frames lost'] <= last['sent']
