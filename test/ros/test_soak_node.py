"""
The detector under a camera of 60 Hz for a while: flat memory, flat latency, every frame accounted.

For 20 s, or as long as the variable SOAK_SECONDS says: SOAK_SECONDS=600 script/test -s
test/ros/test_soak_node.py
"""
from __future__ import annotations

import itertools
import os
from pathlib import Path
import time
from typing import NamedTuple, TYPE_CHECKING

import numpy as np
import pytest
from qflsd_ros.sources import Scene
from rig import image, Rig, values

if TYPE_CHECKING:
    from conftest import Peer

SECONDS = float(os.environ.get('SOAK_SECONDS', 20))
RATE = 60.0             # Hz
WARM_UP = 0.25          # share of the time, at most a minute
GROWTH = 1.0            # MB in a minute
SPREAD = 3.0            # MB that memory goes up and down by


class Sample(NamedTuple):
    """Time in s, memory in MB, median latency in ms."""

    time: float
    memory: float
    latency: float


def memory_of(process: int) -> float:
    """Return the resident memory of a process, MB."""
    pages = int(Path(f'/proc/{process}/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / 1e6


def watch(rig: Rig, seconds: float) -> list[Sample]:
    """Publish frames for some time; return a sample for each report of the detector."""
    scene = Scene(640, 480, lam=-0.3)
    frames = itertools.cycle([image(scene.image(number)) for number in range(0, 200, 10)])
    samples: list[Sample] = []
    begin = time.monotonic()

    def show() -> None:
        message = next(frames)
        message.header.stamp = rig.peer.node.get_clock().now().to_msg()
        rig.publish(message)

    def over() -> bool:
        now = time.monotonic() - begin
        if rig.reports:
            samples.append(Sample(now, memory_of(rig.process.popen.pid),
                                  float(values(rig.reports[-1])['latency median (ms)'])))
        rig.reports.clear()
        rig.received['segments'].clear()
        return now > seconds

    rig.reports.clear()
    rig.peer.until(over, show, period=1 / RATE, timeout=seconds + 60)
    return samples


@pytest.mark.alone
def test_soak(peer: Peer) -> None:
    rig = Rig(peer, lens='estimate').ready()
    rig.settle()
    before = rig.published
    samples = watch(rig, SECONDS)
    rate = (rig.published - before) / SECONDS
    rig.peer.until(rig.accounted, lambda: rig.publish(image(np.zeros((9, 9), np.uint8))),
                   period=0.5)
    settled = [sample for sample in samples if sample.time > min(60, WARM_UP * SECONDS)]
    first, last = settled[:len(settled) // 3], settled[-(len(settled) // 3):]
    times, memory, latency = np.array(settled).T
    slope = 60 * np.polyfit(times, memory, 1)[0]
    late = [float(np.median([sample.latency for sample in some])) for some in (first, last)]
    print(f'\n{SECONDS:.0f} s at {rate:.1f} Hz: memory {memory[0]:.1f} to {memory[-1]:.1f} MB, '
          f'{slope:+.2f} MB a minute; latency {late[0]:.1f}, later {late[1]:.1f} ms; '
          f'{values(rig.reports[-1])}')
    assert len(settled) >= 0.5 * SECONDS
    minutes = (times[-1] - times[0]) / 60
    assert slope * minutes < max(GROWTH * minutes, SPREAD)
    assert np.nanmedian(latency) > 0 and late[1] < 2 * late[0] + 10
    assert 'frames bad: internal error' not in values(rig.reports[-1])
