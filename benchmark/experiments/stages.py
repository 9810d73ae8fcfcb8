"""CPU time of each stage of the detector, by :attr:`qflsd_ros.core.Detector.on_stage`."""
from __future__ import annotations

from collections import defaultdict
import time

from benchmark.experiment import Experiment
from benchmark.peers import TOLERANCE
from benchmark.report import number, section, table
import numpy as np
from qflsd_ros.core import Detector
from tqdm import tqdm

TOTAL = 'all'
REST = 'after the last stage'
POLYLINES = '`Arcs.polylines`'


class Clock:
    """CPU time in ms between consecutive events, by the name of the event that ends it."""

    def __init__(self) -> None:
        self.ms: dict[str, float] = defaultdict(float)
        self._last = time.process_time()

    def __call__(self, name: str) -> None:
        """End a stage; the next one begins now."""
        now = time.process_time()
        self.ms[name] += 1e3 * (now - self._last)
        self._last = now


def costs(gray: np.ndarray, rounds: int) -> dict[str, float]:
    """Return the median CPU time in ms of every stage on an image (H, W) uint8, and their sum."""
    detector = Detector()
    detector.detect(gray)
    samples: dict[str, list[float]] = defaultdict(list)
    for _ in range(rounds):
        detector.on_stage = clock = Clock()
        arcs = detector.detect(gray)
        clock(REST)
        arcs.polylines(TOLERANCE)
        clock(POLYLINES)
        for name, ms in clock.ms.items():
            samples[name].append(ms)
        samples[TOTAL].append(sum(clock.ms.values()))
    return {name: float(np.median(values)) for name, values in samples.items()}


def measure(experiment: Experiment) -> str:
    """Write the section."""
    views = [view for lens in ('regular', 'fisheye')
             for view in experiment.dataset.of_lens(lens, experiment.effort.per_lens)]
    results = [costs(view.gray, experiment.effort.rounds) for view in tqdm(views, 'stages')]
    means = {name: float(np.mean([result[name] for result in results])) for name in results[0]}
    rows = [(name, number(ms), number(100 * ms / means[TOTAL], 1)) for name, ms in means.items()]
    return section(
        'Cost of each stage', f'CPU time of the stages in their order: medians of the rounds on '
        f'an image, means over {len(views)} images.', table(('stage', 'ms', '%'), rows))
