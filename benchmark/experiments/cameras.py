"""Four cameras: one process ``detectors`` against a process ``detector`` for each."""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import re
import sys
import time
from typing import NamedTuple

from benchmark.experiment import Experiment
from benchmark.experiments.memory import KILOBYTE
from benchmark.experiments.node import LAM, message, own_domain, PATIENCE
from benchmark.report import number, section, table
from benchmark.scenes.rendered import room
import numpy as np
from qflsd_ros.cli.processes import Processes
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import Image, PointCloud2

SIDES = ('front', 'left', 'rear', 'right')
SIZE = (640, 480)       # width, height
RATE = 30.0             # Hz
SETTLING = 3.0          # s from the first results, which load more code, to the measurement
IMAGES = 8              # of each camera, in turn
LAST = 1.0              # s for results that are still to come
NODE = (sys.executable, '-m', 'qflsd_ros.ros')
LAYOUTS: dict[str, dict[str, Sequence[str]]] = {
    'four processes `detector`': {
        side: (*NODE, 'detector', '--ros-args', '-r', f'__ns:=/{side}') for side in SIDES},
    'one process `detectors`': {
        'all': (*NODE, 'detectors', '--ros-args', '-p', f'cameras:={list(SIDES)}')}}


class Figures(NamedTuple):
    """Memory in MB of all processes: resident, and proportional; CPU time; ages in s."""

    resident: float
    proportional: float
    cpu: float          # of all processes, share of one core
    ages: np.ndarray    # (N,) from publishing an image to receiving its segments
    sent: int


class Cameras(Node):
    """Publishes the images of all cameras at their rate, and receives the segments."""

    def __init__(self, context: Context, images: list[Image]) -> None:
        super().__init__('benchmark', context=context)
        self._images = images
        self.ages: list[float] = []
        self.seen: set[str] = set()
        self._cameras = {side: self.create_publisher(
            Image, f'/{side}/image', qos_profile_sensor_data) for side in SIDES}
        for side in SIDES:
            self.create_subscription(
                PointCloud2, f'/{side}/detector/segments',
                lambda message, side=side: self._receive(side, message), QoSProfile(depth=5))
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self)

    def play(self, seconds: float) -> int:
        """Publish for a time; return the number of images.  Cameras are out of step."""
        begin = time.monotonic()
        count = int(seconds * RATE) * len(SIDES)
        for k in range(count):
            self._wait(begin + k / RATE / len(SIDES))
            side, image = SIDES[k % len(SIDES)], self._images[k // len(SIDES) % IMAGES]
            now = time.time_ns()
            image.header.stamp.sec, image.header.stamp.nanosec = divmod(now, 10**9)
            self._cameras[side].publish(image)
        return count

    def wait(self, seconds: float) -> None:
        """Receive for a time."""
        self._wait(time.monotonic() + seconds)

    def _wait(self, until: float) -> None:
        while (left := until - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def _receive(self, side: str, message: PointCloud2) -> None:
        stamp = message.header.stamp
        self.ages.append(time.time() - stamp.sec - 1e-9 * stamp.nanosec)
        self.seen.add(side)


@contextmanager
def cameras(commands: dict[str, Sequence[str]], images: list[Image]) -> Iterator[Cameras]:
    """Run the processes of a layout; yield their cameras when all detectors answer."""
    with own_domain() as context, Processes(commands) as processes:
        node = Cameras(context, images)
        end = time.monotonic() + PATIENCE
        while processes.running() and len(node.seen) < len(SIDES):
            if time.monotonic() > end:
                raise TimeoutError(f'not all cameras have answered for {PATIENCE:g} s')
            node.play(1.0)
        yield node


def figures(commands: dict[str, Sequence[str]], images: list[Image], seconds: float) -> Figures:
    """Measure one layout."""
    with cameras(commands, images) as node:
        node.play(SETTLING)
        node.wait(LAST)
        node.ages.clear()
        processes = children()
        cpu, begin = cpu_time(processes), time.monotonic()
        sent = node.play(seconds)
        cpu = (cpu_time(processes) - cpu) / (time.monotonic() - begin)
        node.wait(LAST)
        resident, proportional = (sum(memory_of(pid, key) for pid in processes)
                                  for key in ('Rss', 'Pss'))
        return Figures(resident, proportional, cpu, np.array(node.ages), sent)


def children() -> list[int]:
    """Return the processes of the layout: children of this one that run the nodes."""
    return [pid for pid in map(int, filter(str.isdigit, os.listdir('/proc')))
            if _parent(pid) == os.getpid()]


def _parent(pid: int) -> int:
    try:
        return int(Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[1])
    except OSError:
        return 0    # it has ended


def memory_of(pid: int, key: str) -> float:
    text = Path(f'/proc/{pid}/smaps_rollup').read_text()
    [found] = re.findall(rf'^{key}: +(\d+)', text, re.MULTILINE)
    return int(found) * KILOBYTE


def cpu_time(processes: list[int]) -> float:
    """Return the CPU time of processes in s."""
    ticks = (sum(map(int, Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[11:13]))
             for pid in processes)
    return sum(ticks) / os.sysconf('SC_CLK_TCK')


def measure(experiment: Experiment) -> str:
    """Write the section."""
    images = [message(room(k, LAM, SIZE[::-1]).gray, 'mono8') for k in range(IMAGES)]
    seconds = experiment.effort.endurance / RATE / len(SIDES)
    rows = []
    for name, commands in LAYOUTS.items():
        found = figures(commands, images, seconds)
        median, late = 1e3 * np.percentile(found.ages, (50, 95))
        rows.append((name, number(found.resident, 0), number(found.proportional, 0),
                     number(found.cpu, 2), number(median, 1), number(late, 1),
                     number(len(found.ages) / found.sent, 3)))
    return section(
        'Four cameras', f'{len(SIDES)} cameras of {SIZE[0]}x{SIZE[1]} px at {RATE:g} Hz with '
        f'all defaults, on {os.cpu_count()} cores, which sender and receiver share. Age: from '
        'publishing an image to receiving its segments. Shared pages count once in the '
        'proportional memory.',
        table(('layout', 'resident, MB', 'proportional, MB', 'CPU time, cores',
               'age median, ms', 'age 95 %, ms', 'images with a result'), rows))
