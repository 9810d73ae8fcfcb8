"""The start of the node ``detector``: to the first result, and its memory then and later."""
from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import sys
from tempfile import TemporaryDirectory
import time
from typing import NamedTuple

from benchmark.experiment import Experiment
from benchmark.experiments.cameras import children, cpu_time, memory_of
from benchmark.experiments.node import Client, LAM, message, own_domain
from benchmark.report import number, section, table
from benchmark.scenes.rendered import room
import numpy as np
from qflsd_ros.cli.processes import Processes

NODE = (sys.executable, '-m', 'qflsd_ros.ros', 'detector')
SIZE = (640, 480)       # width, height
LOST = 0.1              # s after which the image is sent again
STARTS = 3              # with cached kernels, of which the median counts
PATIENCE = 600.0        # s for the first start, on a busy machine


class Start(NamedTuple):
    """Wall and CPU time of a node until its first result, s, and memory, MB, after frames."""

    wall: float
    cpu: float
    resident: float
    proportional: float


def start(frames: int) -> Start:
    """Start a node, and let it work on so many frames."""
    image = message(room(0, LAM, SIZE[::-1]).gray, 'mono8')
    with own_domain() as context:
        client = Client(context)
        begin = time.monotonic()
        with Processes({'detector': NODE}):
            while np.isnan(client.latency(image, LOST)):
                if time.monotonic() - begin > PATIENCE:
                    raise TimeoutError(f'the node has not answered for {PATIENCE:g} s')
            wall, cpu = time.monotonic() - begin, cpu_time(children())
            for _ in range(frames):
                client.latency(image)
            resident, proportional = (sum(memory_of(pid, key) for pid in children())
                                      for key in ('Rss', 'Pss'))
    return Start(wall, cpu, resident, proportional)


@contextmanager
def empty_cache() -> Iterator[None]:
    """Let processes that start meanwhile find no compiled kernels."""
    before = os.environ.get('NUMBA_CACHE_DIR')
    with TemporaryDirectory() as folder:
        Path(folder).chmod(0o700)
        os.environ['NUMBA_CACHE_DIR'] = folder
        try:
            yield
        finally:
            if before is None:
                del os.environ['NUMBA_CACHE_DIR']
            else:
                os.environ['NUMBA_CACHE_DIR'] = before


def measure(experiment: Experiment) -> str:
    """Write the section."""
    frames = experiment.effort.endurance
    with empty_cache():
        first = start(0)
        again = start(frames)
    starts = sorted(start(0) for _ in range(STARTS))
    rows = [(name, number(found.wall, 1), number(found.cpu, 2), number(found.resident, 0),
             number(found.proportional, 0)) for name, found in (
        ('the first time: kernels are compiled', first),
        ('kernels in the cache', starts[STARTS // 2]),
        (f'the same, after {frames} frames', again))]
    return section(
        'Start', f'The node `detector`, from the start of its process to the first result of an '
        f'image of {SIZE[0]}x{SIZE[1]} px, on {os.cpu_count()} cores. Memory is that of the '
        'process, where shared pages count once in the proportional one.',
        table(('start', 'wall time, s', 'CPU time, s', 'resident, MB', 'proportional, MB'), rows))


if __name__ == '__main__':
    print(*start(int(sys.argv[1])))
