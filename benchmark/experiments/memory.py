"""Growth of memory while one detector works on many different frames."""
from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import subprocess
import sys

from benchmark import plots
from benchmark.datasets import Dataset, View
from benchmark.experiment import Experiment
from benchmark.peers import OURS
from benchmark.report import number, picture, ROOT, section, table
import cv2
import numpy as np
from qflsd_ros.core import Detector
from tqdm import tqdm

EVERY = 50              # frames between two readings of the memory
SETTLED = 0.2           # share of the frames after which memory should not grow
KILOBYTE = 1.024e-3     # MB


def frames(views: list[View], shape: tuple[int, int], count: int) -> Iterator[np.ndarray]:
    """Yield ``count`` different images (H, W) uint8: flipped and dimmed parts of others."""
    random = np.random.default_rng(0)
    images = [view.gray for view in views]
    height, width = shape
    for _ in range(count):
        gray = images[random.integers(len(images))]
        scale = random.uniform(0.5, 1.0)
        h, w = (max(1, round(scale * side)) for side in gray.shape)
        top, left = random.integers(gray.shape[0] - h + 1), random.integers(gray.shape[1] - w + 1)
        part = cv2.resize(gray[top:top + h, left:left + w], (width, height))
        part = part[::random.choice([-1, 1]), ::random.choice([-1, 1])]
        yield np.rint(random.uniform(0.4, 1.0) * part).astype(np.uint8)


def memory() -> tuple[float, float]:
    """Return the memory of this process now, and its peak, in MB."""
    status = Path('/proc/self/status').read_text()
    now, most = (int(status.split(f'{name}:')[1].split()[0]) for name in ('VmRSS', 'VmHWM'))
    return now * KILOBYTE, most * KILOBYTE


def run(folder: str, shape: tuple[int, int], count: int) -> np.ndarray:
    """Return (N, 3): number of frames, memory then, and its peak until then, MB."""
    views = Dataset.read(folder).views[:24]
    detector = Detector()
    detector.warm_up()
    points = []
    for i, gray in enumerate(tqdm(frames(views, shape, count), 'memory', count)):
        detector.detect(gray)
        if i % EVERY == EVERY - 1:
            points.append((i + 1, *memory()))
    return np.array(points)


def measure(experiment: Experiment) -> str:
    """Write the section; the frames run in a process of their own."""
    height, width = experiment.effort.shape
    command = [sys.executable, '-m', 'benchmark.experiments.memory',
               str(experiment.dataset.folder), str(height), str(width),
               str(experiment.effort.endurance)]
    found = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, cwd=ROOT)
    points = np.array([line.split() for line in found.stdout.splitlines()], float)
    settled = points[points[:, 0] > SETTLED * experiment.effort.endurance]
    slope = 1000 * np.polyfit(settled[:, 0], settled[:, 1], 1)[0]
    path = experiment.figures / 'memory.png'
    plots.save(path, [plots.Panel('', 'frames', 'memory of the process, MB', {
        OURS: (points[:, 0], points[:, 1])}, limits=(0, 1.3 * points[:, 1].max()))])
    return section(
        'Memory', f'One detector, {experiment.effort.endurance} different '
        f'frames of {width}x{height} px: memory of a process of its own, with Python, OpenCV, '
        'numba and the images from which the frames are cut.',
        table(('figure', 'MB'), [
            (f'after {points[0, 0]:.0f} frames', number(points[0, 1], 1)),
            ('at the end', number(points[-1, 1], 1)), ('peak', number(points[-1, 2], 1)),
            ('growth over 1000 frames, after the first fifth', number(slope, 3))]),
        picture(path, experiment.output, 'Memory against frames'))


if __name__ == '__main__':
    for row in run(sys.argv[1], (int(sys.argv[2]), int(sys.argv[3])), int(sys.argv[4])):
        print(*row)
