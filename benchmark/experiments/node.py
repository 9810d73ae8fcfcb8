"""The node: latency of a frame, and CPU time of its messages."""
from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import os
import sys
import time

from benchmark import plots
from benchmark.experiment import Experiment
from benchmark.report import number, picture, ROOT, section, table
from benchmark.scenes.rendered import room
from benchmark.timing import run
import cv2
import numpy as np
from qflsd_ros.cli.demo import free_domain
from qflsd_ros.cli.processes import Processes
from qflsd_ros.core import Arcs, Detector
from qflsd_ros.ros.output import clouds
from qflsd_ros.ros.output.markers import markers
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Header
from tqdm import tqdm

SIZES = (320, 240), (640, 480), (1280, 720), (1920, 1080)       # width, height
LAM = -0.25
PATIENCE = 120.0        # s until the node's first result; a start without cached kernels compiles
LOST = 2.0              # s after which a frame counts as lost
WARM_UP = 3             # first frames of a kind, which do not count
NUMBERS = 10, 30, 100, 300, 1000        # of arcs in a message
ENCODINGS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    'mono8': lambda gray: gray,
    'bgr8': lambda gray: cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR),
    'rgba8': lambda gray: cv2.cvtColor(gray, cv2.COLOR_GRAY2RGBA),
    'mono16': lambda gray: gray.astype(np.uint16) * 257}


class Client(Node):
    """Sends an image and waits for its segments."""

    def __init__(self, context: Context) -> None:
        super().__init__('benchmark', context=context)
        self.lost = 0
        self._sent = 0
        self._answer = -1
        self._images = self.create_publisher(Image, 'image', qos_profile_sensor_data)
        self.create_subscription(PointCloud2, 'detector/segments', self._receive,
                                 QoSProfile(depth=5))
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self)

    def latency(self, image: Image, patience: float = LOST) -> float:
        """Return s from publishing an image to receiving its segments; nan if it was lost."""
        self._sent += 1
        image.header.stamp.nanosec = self._sent
        start = time.perf_counter()
        self._images.publish(image)
        while self._answer != self._sent:
            self._executor.spin_once(timeout_sec=0.1)
            if time.perf_counter() - start > patience:
                self.lost += 1
                return float('nan')
        return time.perf_counter() - start

    def connect(self, image: Image) -> None:
        """Send images until segments come."""
        end = time.monotonic() + PATIENCE
        while np.isnan(self.latency(image, 0.5)):
            if time.monotonic() > end:
                raise TimeoutError(f'the node has not answered for {PATIENCE:g} s')
        self.lost = 0

    def _receive(self, message: PointCloud2) -> None:
        self._answer = message.header.stamp.nanosec


@contextmanager
def own_domain() -> Iterator[Context]:
    """Yield a context in a ROS domain of its own, which processes started meanwhile share."""
    domain = free_domain()
    os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
    # Both sides need this profile: without it, images of more than 512 KiB are lost.
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(ROOT / 'config' / 'fastdds.xml'))
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    try:
        yield context
    finally:
        rclpy.try_shutdown(context=context)


@contextmanager
def client() -> Iterator[Client]:
    """Run the node as a process of its own; yield a client of it."""
    with own_domain() as context, Processes(
            {'detector': (sys.executable, '-m', 'qflsd_ros.ros', 'detector')}):
        yield Client(context)


def message(gray: np.ndarray, encoding: str) -> Image:
    """Return an image (H, W) uint8 as a message in one of :data:`ENCODINGS`."""
    pixels = ENCODINGS[encoding](gray)
    return Image(height=gray.shape[0], width=gray.shape[1], encoding=encoding,
                 step=pixels.strides[0], data=array('B', pixels.tobytes()))


def latencies(experiment: Experiment) -> str:
    """Return the table of latencies."""
    sizes = SIZES[:max(1, len(SIZES) - experiment.effort.every + 1)]
    images = {size: room(0, LAM, size[::-1]).gray for size in sizes}
    rows = []
    with client() as to:
        to.connect(message(images[sizes[0]], 'mono8'))
        for size, encoding in tqdm([(s, e) for s in sizes for e in ENCODINGS], 'node latency'):
            image = message(images[size], encoding)
            times = [to.latency(image) for _ in range(WARM_UP + experiment.effort.latencies)]
            median, late = 1e3 * np.nanpercentile(times[WARM_UP:], (50, 95))
            rows.append((f'{size[0]}x{size[1]}', encoding, number(median, 1), number(late, 1),
                         to.lost))
            to.lost = 0
    return table(('size', 'encoding', 'median, ms', '95 %, ms', 'lost'), rows)


def message_costs(rounds: int) -> dict[str, list[float]]:
    """Return the CPU time in ms of building and serialising each output, for :data:`NUMBERS`."""
    arcs = Detector().detect(room(0, LAM, (1080, 1920)).gray)
    header = Header(frame_id='camera')
    build = {
        'segments': lambda some: serialize_message(clouds.segments(header, some, 0.1)),
        'arcs': lambda some: serialize_message(clouds.arc_records(header, some)),
        'markers': lambda some: markers(header, some, 0.1, 0.001, 1)}
    costs: dict[str, list[float]] = {name: [] for name in build}
    for count in NUMBERS:
        some = repeated(arcs, count)
        for name, function in build.items():
            times = [run(function, some)[0] for _ in range(rounds + 1)][1:]
            costs[name].append(1e3 * float(np.median(times)))
    return costs


def repeated(arcs: Arcs, count: int) -> Arcs:
    """Return a result of ``count`` arcs, without pixels, that repeats those of another."""
    if not len(arcs):
        raise ValueError('arcs is empty: must have at least one arc')
    table_ = np.resize(arcs.table, count)
    return Arcs(table_, np.zeros((0, 2)), np.zeros((0, 2), np.int32), np.zeros(count + 1, int))


def measure(experiment: Experiment) -> str:
    """Write the section."""
    costs = message_costs(experiment.effort.rounds)
    path = experiment.figures / 'messages.png'
    plots.save(path, [plots.Panel('Building and serialising', 'arcs', 'CPU time, ms', {
        f'~/{name}': (NUMBERS, times) for name, times in costs.items()}, logarithmic='xy')])
    kinds: Sequence[str] = ('PointCloud2', 'PointCloud2', 'MarkerArray')
    rows = [(f'`~/{name}`', kind, *(number(ms) for ms in times))
            for (name, times), kind in zip(costs.items(), kinds)]
    return section(
        'The node', 'From publishing an image to receiving its segments, over DDS between two '
        'processes, one frame at a time, wall time; the frame is a rendered room. The '
        'figures include the time of the sender and receiver, which is Python, too.',
        latencies(experiment),
        'CPU time in ms to build and serialise one message, by its number of arcs:',
        table(('topic', 'type', *(f'{count} arcs' for count in NUMBERS)), rows),
        picture(path, experiment.output, 'Cost of messages against number of arcs'))
