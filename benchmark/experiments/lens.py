"""The estimate of the lens from single frames: its error, its deviation, and its use."""
from __future__ import annotations

from collections.abc import Callable
import math
from typing import NamedTuple

from benchmark.experiment import Experiment
from benchmark.experiments import known_lens
from benchmark.report import number, section, significant, table
from benchmark.scenes.rendered import room, TURN
from benchmark.timing import run
import numpy as np
from qflsd_ros.core import Detector, DivisionModel, estimate_distortion
from tqdm import tqdm

LAMBDAS = 0.0, -0.1, -0.25, -0.5, -0.8
FRAMES_A_VIEW = 4       # frames of the room for each of its viewpoints under other conditions


EXPLANATION = (
    'Lambda from the arcs of single frames of the rendered room; *estimated*: frames with an '
    'estimate, in the others the lens is not observable; error over deviation: rms, 1 for a '
    'correct '
    'deviation; ms: median CPU time of the estimate alone; sagitta: its error, for arcs below '
    f'{known_lens.SHORT:g} px, median, px, lens unknown / known.')


class Measured(NamedTuple):
    """
    The estimate of the lens from one frame.

    Error of lambda and that over its deviation, nan if there is none; CPU time of the estimate,
    ms; errors of short arcs' sagitta with the lens unknown and known, (M,) px.
    """

    error: float
    normalised: float
    ms: float
    unknown: np.ndarray
    known: np.ndarray


def estimate(number_: int, lam: float, shape: tuple[int, int]) -> Measured:
    """Estimate the lens through which a frame of the room was rendered."""
    gray, lens, detector = room(number_, lam, shape).gray, DivisionModel(lam, shape), Detector()
    arcs = detector.detect(gray)
    seconds, found = run(estimate_distortion, [arcs], shape)
    sagittas = [known_lens.sagitta_errors(some, lens)
                for some in (arcs, detector.detect(gray, lens=lens))]
    if found is None:
        return Measured(math.nan, math.nan, 1e3 * seconds, *sagittas)
    error = found.lam - lam
    return Measured(error, error / found.std, 1e3 * seconds, *sagittas)


def measure(experiment: Experiment) -> str:
    """Write the section."""
    effort = experiment.effort
    frames = range(0, TURN, TURN // (FRAMES_A_VIEW * effort.viewpoints))
    estimate(0, LAMBDAS[0], effort.shape)
    rows = [(f'{lam:g}', *_cells([estimate(i, lam, effort.shape) for i in frames]))
            for lam in tqdm(LAMBDAS[::effort.every], 'lenses')]
    return section(
        'The lens', EXPLANATION,
        table(('lambda', 'frames', 'estimated', 'error, median', 'error, largest',
               'error over deviation', 'ms', 'sagitta'), rows),
        known_lens.EXPLANATION, known_lens.measure(experiment))


def _cells(measured: list[Measured]) -> list[object]:
    error, normalised, ms = np.array([frame[:3] for frame in measured]).T
    estimated = np.isfinite(error)
    off = np.abs(error[estimated])
    unknown, known = (np.concatenate([getattr(frame, which) for frame in measured])
                      for which in ('unknown', 'known'))
    return [len(measured), int(estimated.sum()), number(_or_nan(np.median, off), 4),
            number(_or_nan(np.max, off), 4), number(_or_nan(_rms, normalised[estimated]), 2),
            significant(float(np.median(ms))),
            f'{number(_or_nan(np.median, unknown))} / {number(_or_nan(np.median, known))}']


def _rms(values: np.ndarray) -> float:
    return np.sqrt(np.mean(values ** 2))


def _or_nan(figure: Callable[[np.ndarray], float], values: np.ndarray) -> float:
    return float(figure(values)) if len(values) else math.nan
