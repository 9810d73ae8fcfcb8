"""Overhead of the node: the parts of a frame's time, and the rate that one core sustains."""
from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
import itertools
import os
from pathlib import Path
import subprocess
import sys
import time

from benchmark.experiment import Experiment
from benchmark.experiments.node import message, PATIENCE
from benchmark.report import number, ROOT, section, table
from benchmark.scenes.rendered import room
from benchmark.timing import run
from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from qflsd_ros.cli.demo import free_domain
from qflsd_ros.core import Detector
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import Image, PointCloud2

LAM = -0.25
FRAMES = 8              # different ones, in a cycle
ROUNDS = 5              # in which all nodes are measured in turn
DETECTOR = 'import sys; from qflsd_ros.ros.__main__ import detector; sys.exit(detector())'
ON_ONE_CORE = 'import os; os.sched_setaffinity(0, {max(os.sched_getaffinity(0))}); ' + DETECTOR
# A minimal node of rclpy: it answers each image with as many bytes as segments have.
ECHO = """
from array import array
import rclpy
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image, PointCloud2
rclpy.init()
node = rclpy.create_node('echo')
publisher = node.create_publisher(PointCloud2, 'detector/segments', 5)
answer = PointCloud2(data=array('B', bytes(6000)))
def receive(image):
    answer.header = image.header
    publisher.publish(answer)
node.create_subscription(Image, 'image', receive, qos_profile_sensor_data)
rclpy.spin(node)
"""
# width, height, encoding, Hz, topic
LOADS = ((640, 480, 'mono8', 30, 'segments'), (1280, 720, 'bgr8', 60, 'segments'),
         (1280, 720, 'bgr8', 30, 'overlay'), (1280, 720, 'bgr8', 60, 'overlay'))


class Camera(Node):
    """Publishes frames at a rate, and measures the time until each answer, ms."""

    def __init__(self, context: Context, images: list[Image], topic: str) -> None:
        super().__init__('benchmark', context=context, enable_rosout=False)
        self.totals: list[float] = []
        self.counts: dict[str, str] = {}
        self.process: subprocess.Popen[bytes] | None = None
        self._images = itertools.cycle(images)
        self._publisher = self.create_publisher(Image, 'image', qos_profile_sensor_data)
        self.create_subscription(Image if topic == 'overlay' else PointCloud2,
                                 f'detector/{topic}', self._receive, QoSProfile(depth=5))
        self.create_subscription(DiagnosticArray, '/diagnostics', self._report, 5)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self)

    def connect(self) -> None:
        """Publish frames until the first answer."""
        end = time.monotonic() + PATIENCE
        while not self.totals:
            self.play(0.5, 10)
            if time.monotonic() > end:
                raise TimeoutError(f'the node has not answered for {PATIENCE:g} s')

    def play(self, seconds: float, rate: float) -> int:
        """Publish frames for a time in s at a rate in Hz; return their number."""
        self.totals.clear()
        begin, sent = time.monotonic(), 0
        while (now := time.monotonic() - begin) < seconds:
            if now * rate >= sent:
                image, sent = next(self._images), sent + 1
                image.header.stamp = self.get_clock().now().to_msg()
                self._publisher.publish(image)
            self._executor.spin_once(max(0, begin + sent / rate - time.monotonic()))
        return sent

    def cpu(self) -> float:
        """Return the CPU time of the node's process so far, s."""
        assert self.process is not None
        fields = Path(f'/proc/{self.process.pid}/stat').read_text().rpartition(')')[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')

    def _receive(self, answer: Image | PointCloud2) -> None:
        stamp = answer.header.stamp
        now = self.get_clock().now().nanoseconds
        self.totals.append((now - stamp.sec * 10**9 - stamp.nanosec) * 1e-6)

    def _report(self, report: DiagnosticArray) -> None:
        self.counts = {item.key: item.value for item in report.status[0].values}


@contextmanager
def camera(code: str, images: list[Image], topic: str) -> Iterator[Camera]:
    """Run a node as a process of its own; yield a camera connected to it."""
    domain = free_domain()
    os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(ROOT / 'config' / 'fastdds.xml'))
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    process = subprocess.Popen([sys.executable, '-c', code])
    try:
        result = Camera(context, images, topic)
        result.process = process
        result.connect()
        yield result
    finally:
        process.kill()
        process.wait()
        rclpy.try_shutdown(context=context)


@cache
def pictures(width: int, height: int) -> list[np.ndarray]:
    """Return the frames of the camera, (height, width) uint8 each."""
    return [room(i, LAM, (height, width)).gray for i in range(FRAMES)]


def detection(grays: list[np.ndarray], seconds: float, rate: float) -> list[float]:
    """Return the CPU times of the detection, ms, at the pace of the camera."""
    detector, times = Detector(), []
    for gray in itertools.islice(itertools.cycle(grays), int(seconds * rate)):
        times.append(1e3 * run(detector.detect, gray)[0])
        time.sleep(1 / rate)  # as in the node, the processor caches go cold in between
    return times[FRAMES:]


def breakdown(seconds: float) -> str:
    """Return the table of the parts of a frame's time."""
    width, height, encoding, rate, topic = LOADS[0]
    grays = pictures(width, height)
    images = [message(gray, encoding) for gray in grays]
    times: dict[str, list[float]] = {'alone': [], 'echo': [], 'total': []}
    with camera(ECHO, images, topic) as to_echo, camera(DETECTOR, images, topic) as to:
        for _ in range(ROUNDS):     # in turn: a slow phase of the machine slows all
            times['alone'] += detection(grays, seconds / ROUNDS, rate)
            for name, node in (('echo', to_echo), ('total', to)):
                node.play(seconds / ROUNDS, rate)
                times[name] += node.totals
        latency, age = (float(to.counts[f'{key} median (ms)']) for key in ('latency', 'age'))
    alone, echo, total = (float(np.median(times[name])) for name in ('alone', 'echo', 'total'))
    rows = [('from stamp to received', total),
            ('of that: from stamp to arrival in the node (publishing, DDS, rclpy)', age - latency),
            ('of that: from arrival to published', latency),
            ('detection alone, CPU time', alone),
            ('from stamp to received, of a node that only echoes', echo),
            ('overhead: total less detection and echo', total - alone - echo)]
    return table((f'{width}x{height} {encoding} at {rate} Hz', 'ms'),
                 [(name, number(ms, 2)) for name, ms in rows])


def sustained(seconds: float, every: int) -> str:
    """Return the table of rates under load, on one core."""
    rows = []
    for width, height, encoding, rate, topic in LOADS[::every]:
        images = [message(gray, encoding) for gray in pictures(width, height)]
        with camera(ON_ONE_CORE, images, topic) as to:
            begin, cpu = time.monotonic(), to.cpu()
            sent = to.play(seconds, rate)
            busy = (to.cpu() - cpu) / (time.monotonic() - begin)
            rows.append((
                f'{width}x{height} {encoding}, `~/{topic}`', rate, number(sent / seconds, 1),
                number(len(to.totals) / seconds, 1), number(float(np.median(to.totals)), 1),
                f'{100 * busy:.0f}', to.counts['frames dropped'], to.counts['frames lost']))
    return table(('frames', 'wanted, Hz', 'sent, Hz', 'answered, Hz', 'stamp to received, ms',
                  'CPU, % of a core', 'dropped', 'lost'), rows)


def measure(experiment: Experiment) -> str:
    """Write the section."""
    every = experiment.effort.every
    seconds = 10.0 if every == 1 else 2.5
    return section(
        'Overhead of the node', 'Medians of wall time; the frames are rendered rooms.',
        breakdown(seconds), 'Under load, with the detector bound to one core; the sender is '
        'in Python, too:', sustained(seconds, every))
