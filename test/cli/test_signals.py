"""Signals at any moment: one line, nothing half-written, no process left."""
from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Callable, Iterator

import cv2
import numpy as np
import pytest

COUNT = 12


def hear_all() -> None:
    """Hear all signals: a shell's background jobs ignore SIGINT, those of nohup SIGHUP."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def poll(condition: Callable[[], object], seconds: float = 60.0) -> None:
    """Wait until a condition holds, and fail when it never does."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.fixture
def slow(tmp_path: Path) -> Path:
    """Return a folder of images that take the method paper half a second each."""
    folder = tmp_path / 'in'
    folder.mkdir()
    generator = np.random.default_rng(0)
    for number in range(COUNT):
        pixels = np.full((240, 320), 30, np.uint8)
        for x, y, radius in generator.integers(20, 220, (15, 3)).tolist():
            cv2.circle(pixels, (x, y), radius, x % 200 + 50, 2)
        cv2.imwrite(str(folder / f'{number:02d}.png'), pixels)
    return folder


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start the command in a group of its own; what is left of it goes in the end."""
    started = []

    def run(*arguments: object) -> subprocess.Popen[str]:
        started.append(subprocess.Popen(
            [sys.executable, '-m', 'qflsd_ros.cli.detect', *map(str, arguments), '--output',
             str(tmp_path / 'out')], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True, preexec_fn=hear_all))
        return started[-1]

    yield run
    for process in started:
        if group(process.pid):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def group(number: int) -> list[int]:
    """Return the processes of a session, but for those that are dead."""
    found = []
    for path in Path('/proc').glob('[0-9]*/stat'):
        try:
            state, _, _, session = path.read_text().rpartition(')')[2].split()[:4]
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(session) == number and state != 'Z':
            found.append(int(path.parent.name))
    return found


def workers(number: int) -> list[int]:
    """Return the worker processes of a session."""
    found = []
    for process in group(number):
        try:
            command = Path(f'/proc/{process}/cmdline').read_bytes()
        except (FileNotFoundError, ProcessLookupError):
            continue
        if b'spawn_main' in command:
            found.append(process)
    return found


def results(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob('*.json'))


def hidden(folder: Path) -> list[Path]:
    return list(folder.rglob('.*'))


# SIGINT with several jobs: see the next test.
@pytest.mark.parametrize('number, jobs', [
    (signal.SIGINT, 1), (signal.SIGTERM, 2), (signal.SIGHUP, 1)])
def test_an_end_is_one_line_and_leaves_nothing(
        slow: Path, tmp_path: Path, start: Callable[..., subprocess.Popen[str]],
        number: signal.Signals, jobs: int) -> None:
    """Sent to the command alone; of Ctrl-C the others hear as well."""
    process, output = start(slow, '--method', 'paper', '--jobs', jobs), tmp_path / 'out'
    poll(lambda: results(output))
    os.kill(process.pid, number)
    _, stderr = process.communicate(timeout=30)
    assert process.returncode == 128 + number
    assert stderr == (f'detect: interrupted by {number.name}; all files written so far are '
                      'complete\n')
    poll(lambda: not group(process.pid), 10)
    assert not hidden(output)


def test_ctrl_c_reaches_all_and_is_one_line(
        slow: Path, tmp_path: Path, start: Callable[..., subprocess.Popen[str]]) -> None:
    process = start(slow, '--method', 'paper', '--jobs', 2)
    poll(lambda: results(tmp_path / 'out'))
    os.killpg(process.pid, signal.SIGINT)
    _, stderr = process.communicate(timeout=30)
    assert process.returncode == 130
    assert stderr == 'detect: interrupted by SIGINT; all files written so far are complete\n'
    poll(lambda: not group(process.pid), 10)


def test_a_video_that_is_ended_leaves_nothing(
        tmp_path: Path, start: Callable[..., subprocess.Popen[str]]) -> None:
    path = tmp_path / 'v.avi'
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*'MJPG'), 10, (64, 48))
    for _ in range(3000):
        writer.write(np.zeros((48, 64, 3), np.uint8))
    writer.release()
    process = start(path)
    poll(lambda: len(list((tmp_path / 'out').glob('v/*'))) > 50)
    process.terminate()
    assert process.wait(30) == 143
    assert not hidden(tmp_path / 'out')


def test_workers_end_when_the_command_is_killed(
        slow: Path, tmp_path: Path, start: Callable[..., subprocess.Popen[str]]) -> None:
    process = start(slow, '--method', 'paper', '--jobs', 2)
    poll(lambda: results(tmp_path / 'out'))
    process.kill()
    poll(lambda: not group(process.pid), 30)
    assert len(results(tmp_path / 'out')) < COUNT


def test_a_killed_worker_costs_its_own_picture(
        slow: Path, tmp_path: Path, start: Callable[..., subprocess.Popen[str]]) -> None:
    """It is named, another process takes its place, and the rest is done."""
    process, output = start(slow, '--method', 'paper', '--jobs', 2), tmp_path / 'out'
    killed = []
    for done in (1, 4):
        poll(lambda: len(results(output)) >= done)
        killed.append(workers(process.pid)[0])
        os.kill(killed[-1], signal.SIGKILL)
    stdout, stderr = process.communicate(timeout=120)
    assert process.returncode == 1 and 'Traceback' not in stderr
    lost = [line for line in stderr.splitlines() if line.endswith(' was killed')]
    assert 1 <= len(lost) <= 2 and len(stderr.splitlines()) == len(lost)
    assert len(results(output)) == COUNT - len(lost)
    for line in lost:
        name, = (name for name in (f'{i:02d}' for i in range(COUNT)) if f"on '{name}'" in line)
        assert f'{name}.json' not in results(output)
    assert f'{len(lost)} failed' in stdout and not hidden(output)
