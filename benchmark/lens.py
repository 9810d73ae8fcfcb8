"""The lens by the arcs of single frames: how far off, how honest, how long it takes."""
from __future__ import annotations

from collections.abc import Callable
import math
import time
from typing import NamedTuple

from benchmark.experiment import Experiment
from benchmark.rendered import room, TURN
from benchmark.report import number, section, significant, table
import numpy as np
from qflsd_ros.core import Detector, estimate_distortion
from tqdm import tqdm

LAMBDAS = 0.0, -0.1, -0.25, -0.5, -0.8
FRAMES_A_VIEW = 4       # frames of the room for each of its viewpoints under other conditions


class Measured(NamedTuple):
    """Of one frame: error of lambda and that over its deviation, nan if there is none, and ms."""

    error: float
    normalised: float
    ms: float


def estimate(number_: int, lam: float, shape: tuple[int, int]) -> Measured:
    """Estimate the lens through which a frame of the room was rendered."""
    arcs = Detector().detect(room(number_, lam, shape).gray)
    begin = time.process_time()
    found = estimate_distortion([arcs], shape)
    ms = 1e3 * (time.process_time() - begin)
    if found is None:
        return Measured(math.nan, math.nan, ms)
    return Measured(found.lam - lam, (found.lam - lam) / found.std, ms)


def measure(experiment: Experiment) -> str:
    """Write the section."""
    effort = experiment.effort
    frames = range(0, TURN, TURN // (FRAMES_A_VIEW * effort.viewpoints))
    estimate(0, LAMBDAS[0], effort.shape)
    rows = []
    for lam in tqdm(LAMBDAS[::effort.every], 'lenses'):
        error, normalised, ms = np.array([estimate(i, lam, effort.shape) for i in frames]).T
        told = np.isfinite(error)
        off = np.abs(error[told])
        rows.append((f'{lam:g}', len(frames), int(told.sum()),
                     number(_or_nan(np.median, off), 4), number(_or_nan(np.max, off), 4),
                     number(_or_nan(_rms, normalised[told]), 2),
                     significant(float(np.median(ms)))))
    return section(
        'The lens', 'Lambda from the arcs of single frames of the rendered room; *told*: frames '
        'that tell it, all others say so; error over deviation: rms, 1 where the deviation is '
        'honest; CPU time of the estimate alone, median.',
        table(('lambda', 'frames', 'told', 'error, median', 'error, largest',
               'error over deviation', 'ms'), rows))


def _rms(values: np.ndarray) -> float:
    return np.sqrt(np.mean(values ** 2))


def _or_nan(figure: Callable[[np.ndarray], float], values: np.ndarray) -> float:
    return float(figure(values)) if len(values) else math.nan
