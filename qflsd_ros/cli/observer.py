"""A node that watches a camera and the detector: how many, how fast, and what it looks like."""
from __future__ import annotations

from dataclasses import dataclass, field
import time
from typing import Callable, Iterable
import zlib

from builtin_interfaces.msg import Time
import numpy as np
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import Image, PointCloud2

RECORDED = 60.0  # s; older stamps come from a recording and say nothing of latency
REMEMBERED = 64     # newest images of which it is known what they show


@dataclass
class Counts:
    """What came in a stretch of time: frames, results, arcs of each, latency (s) of each."""

    frames: int = 0
    results: int = 0
    arcs: list[int] = field(default_factory=list)
    latencies: list[float] = field(default_factory=list)

    def __str__(self) -> str:
        """Return a line for people."""
        arcs = f'{np.mean(self.arcs):4.0f}' if self.arcs else '   -'
        latency = 'latency     - ms, p95     - ms'
        if self.latencies:
            median, late = np.percentile(self.latencies, (50, 95)) * 1e3
            latency = f'latency {median:5.1f} ms, p95 {late:5.1f} ms'
        return f'in {self.frames:4d}, out {self.results:4d}, arcs {arcs}, {latency}'

    def add(self, other: Counts) -> None:
        """Add what came in another stretch of time."""
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
        What came since :meth:`take`; None before an image and a result have come.

    """

    def __init__(self, shows: Iterable[Callable[[np.ndarray, int | None], None]]) -> None:
        """
        Call all of ``shows`` with every overlay, (H, W, 3) uint8 B, G, R, and what it is of.

        That is the CRC of the image that was sent, which is the same whenever that is sent again,
        though more may be found in it once the lens is known; None where it did not come here.
        """
        super().__init__('demo')
        self.counts: Counts | None = None
        self._shows = shows
        self._newest: Time | None = None
        self._images: dict[tuple[int, int], int] = {}       # CRC by stamp
        reliable = QoSProfile(depth=5)
        self.create_subscription(Image, 'image', self._count_frame, qos_profile_sensor_data)
        self.create_subscription(PointCloud2, 'detector/segments', self._count_result, reliable)
        self.create_subscription(PointCloud2, 'detector/arcs', self._count_arcs, reliable)
        self.create_subscription(Image, 'detector/overlay', self._take_overlay, reliable)

    def take(self) -> Counts:
        """Return what came since the last time, or since the first result."""
        taken, self.counts = self.counts or Counts(), Counts()
        return taken

    def age(self) -> str:
        """Say how old the newest result is, by its stamp."""
        age = None if self._newest is None else _since(self._newest)
        return 'age (recorded)' if age is None else f'age {age * 1e3:5.1f} ms'

    def _count_frame(self, message: Image) -> None:
        self._images[_key(message.header.stamp)] = zlib.crc32(message.data)
        if len(self._images) > REMEMBERED:
            del self._images[next(iter(self._images))]
        if self.counts is not None:
            self.counts.frames += 1

    def _count_result(self, message: PointCloud2) -> None:
        if not self._images:
            return      # DDS may tell of the detector seconds before it tells of the camera
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
