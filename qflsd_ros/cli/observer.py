"""A node that counts the messages of a camera and the detector, and passes overlays on."""
from __future__ import annotations

from dataclasses import dataclass, field
import time
from typing import Callable, Iterable
import zlib

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from qflsd_ros.ros.kernels import COMPILING
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import Image, PointCloud2

# s; an older stamp comes from a recording and gives no latency.  Chosen: far above any latency.
RECORDED = 60.0
REMEMBERED = 64     # newest images whose CRCs wait for their overlays: 2 s at 30 Hz
# Takes an overlay, (H, W, 3) uint8 B, G, R, and the CRC of its image, None where that is unknown.
Show = Callable[[np.ndarray, 'int | None'], None]


@dataclass
class Counts:
    """Frames and results in a period of time, with the number of arcs and latency (s) of each."""

    frames: int = 0
    results: int = 0
    arcs: list[int] = field(default_factory=list)
    latencies: list[float] = field(default_factory=list)

    def __str__(self) -> str:
        """Return the counts, mean number of arcs and latencies as a line of text."""
        arcs = f'{np.mean(self.arcs):4.0f}' if self.arcs else '   -'
        latency = 'latency     - ms, p95     - ms'
        if self.latencies:
            median, late = np.percentile(self.latencies, (50, 95)) * 1e3
            latency = f'latency {median:5.1f} ms, p95 {late:5.1f} ms'
        return f'in {self.frames:4d}, out {self.results:4d}, arcs {arcs}, {latency}'

    def add(self, other: Counts) -> None:
        """Add the counts of another period of time."""
        self.frames += other.frames
        self.results += other.results
        self.arcs += other.arcs
        self.latencies += other.latencies


class Observer(Node):
    """
    Subscribes to ``image`` and to the outputs of the detector.

    Attributes
    ----------
    counts
        Counts since the last :meth:`take`; None before an image and a result have come.
    compiling
        The newest report of the detector on compiling its kernels; empty before the first one.

    """

    def __init__(self, shows: Iterable[Show]) -> None:
        """
        Call all of ``shows`` with every overlay and the CRC of its image.

        An image that is published repeatedly has the same CRC each time, while its overlay may
        change once the lens is known. The CRC is None where the image itself was not received.
        """
        super().__init__('demo')
        self.counts: Counts | None = None
        self.compiling = ''
        self._shows = shows
        self._newest: Time | None = None
        self._images: dict[tuple[int, int], int] = {}       # CRC by stamp
        reliable = QoSProfile(depth=5)
        self.create_subscription(Image, 'image', self._count_frame, qos_profile_sensor_data)
        self.create_subscription(PointCloud2, 'detector/segments', self._count_result, reliable)
        self.create_subscription(PointCloud2, 'detector/arcs', self._count_arcs, reliable)
        self.create_subscription(Image, 'detector/overlay', self._take_overlay, reliable)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._note_progress, reliable)

    def take(self) -> Counts:
        """Return the counts since the last call, or since the first result."""
        taken, self.counts = self.counts or Counts(), Counts()
        return taken

    def age(self) -> str:
        """Return the age of the newest result, by its stamp, as text."""
        age = None if self._newest is None else _since(self._newest)
        return 'age (recorded)' if age is None else f'age {age * 1e3:5.1f} ms'

    def _note_progress(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.message.startswith(COMPILING):
                self.compiling = status.message

    def _count_frame(self, message: Image) -> None:
        self._images[_key(message.header.stamp)] = zlib.crc32(message.data)
        if len(self._images) > REMEMBERED:
            del self._images[next(iter(self._images))]
        if self.counts is not None:
            self.counts.frames += 1

    def _count_result(self, message: PointCloud2) -> None:
        if not self._images:
            return      # DDS may discover the detector seconds before the camera
        if self.counts is None:
            self.counts = Counts(frames=1)
        self.counts.results += 1
        self._newest = message.header.stamp
        latency = _since(message.header.stamp)
        if latency is not None:
            self.counts.latencies.append(latency)

    def _count_arcs(self, message: PointCloud2) -> None:
        if self.counts is not None:
            self.counts.arcs.append(message.width)

    def _take_overlay(self, message: Image) -> None:
        rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
        pixels = rows[:, :3 * message.width].reshape(message.height, message.width, 3)
        for show in self._shows:
            show(pixels, self._images.get(_key(message.header.stamp)))


def _key(stamp: Time) -> tuple[int, int]:
    return stamp.sec, stamp.nanosec


def _since(stamp: Time) -> float | None:
    seconds = time.time() - (stamp.sec + stamp.nanosec * 1e-9)
    return seconds if abs(seconds) < RECORDED else None
