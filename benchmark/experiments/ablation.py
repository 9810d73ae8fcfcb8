"""
The gain of each departure from the published method, added one after the other.

The steps combine the published method (:mod:`qflsd_ros.core.paper`) and the detector: a step
replaces single functions of both while it runs.
"""
from __future__ import annotations

from collections.abc import Callable
import dataclasses
import inspect
import time
from typing import Any, NamedTuple
from unittest import mock

from benchmark.datasets import View
from benchmark.experiment import Experiment
from benchmark.experiments import triples
from benchmark.metrics import Comparison, Counts, sample
from benchmark.parallel import each
from benchmark.peers import published, TOLERANCE
from benchmark.report import number, section, significant, table
import numpy as np
from qflsd_ros.core import Arcs, Detector, paper, Parameters
from qflsd_ros.core.detection.contours import chains, edges

MIN_TRUTH = 20.0            # px, shortest line that counts
BARE = Parameters(max_gap=0.0, min_score=-1000.0, min_distance=0.0)


def _named(kernel: Any, arguments: tuple[Any, ...], *names: str) -> list[Any]:
    """Return the arguments of a kernel that belong to parameters of these names."""
    bound = inspect.signature(kernel.py_func).bind(*arguments).arguments
    return [bound[name] for name in names]


def _segments(contour: np.ndarray, parameters: Parameters, _: object) -> list[np.ndarray]:
    """Return the segments of a contour (n, 2) px, by distances in px."""
    runs = triples.search(contour, parameters.tolerance, parameters.min_length,
                          parameters.paper_seed)
    return [contour[first:last + 1] for first, last in runs]


def _chains(gray: np.ndarray, parameters: Parameters) -> list[np.ndarray]:
    """Return our chains in place of the paper's contours, (n, 2) float64 each."""
    found: list[np.ndarray] = []
    trace = chains.trace

    def tapped(*arguments: Any) -> int:
        count = trace(*arguments)
        pixels, offsets = _named(trace, arguments, 'pixels', 'offsets')
        ys, xs = np.divmod(pixels[:offsets[count]], gray.shape[1])
        found.extend(np.column_stack([xs[a:b], ys[a:b]]).astype(float)
                     for a, b in zip(offsets[:count], offsets[1:count + 1]))
        return count

    with mock.patch.object(chains, 'trace', tapped):
        Detector(BARE).detect(gray)
    return found


def _whole_pixels(*arguments: Any) -> None:
    """Locate edges at the centres of their pixels."""
    _LOCATE(*arguments)
    width, pixels, n, points = _named(_LOCATE, arguments, 'width', 'pixels', 'n', 'points')
    points[1, :n], points[0, :n] = np.divmod(pixels[:n], width)


_LOCATE = edges.locate


def _as_published(gray: np.ndarray) -> Arcs:
    return Detector(published()).detect(gray)


def _with_distance(gray: np.ndarray, **more: Any) -> Arcs:
    with mock.patch.multiple(paper, segments=_segments, **more):
        return _as_published(gray)


def _with_chains(gray: np.ndarray) -> Arcs:
    return _with_distance(gray, contours=_chains)


def _with_windows(gray: np.ndarray) -> Arcs:
    with mock.patch.object(edges, 'locate', _whole_pixels):
        return Detector(BARE).detect(gray)


STEPS: dict[str, Callable[[np.ndarray], Arcs]] = {
    'as published (numpy)': _as_published,
    '+ distance in px (compiled)': _with_distance,
    '+ chains': _with_chains,
    '+ windows': _with_windows,
    '+ subpixel': Detector(BARE).detect,
    '+ validation': Detector(dataclasses.replace(Parameters(), max_gap=0.0)).detect,
    '+ joining: the defaults': Detector().detect}


class Task(NamedTuple):
    """An image for a step."""

    step: str
    view: View


class Outcome(NamedTuple):
    """Counts of all lines and of curved ones, and the CPU time in s."""

    every: Counts
    curved: Counts
    seconds: float


def count(task: Task) -> Outcome:
    """Run a step on an image, after a first run that compiles, on a small part of it."""
    gray, detect = task.view.gray, STEPS[task.step]
    detect(gray[:64, :64])
    start = time.process_time()
    arcs = detect(gray)
    seconds = time.process_time() - start
    comparison = Comparison(sample(arcs.polylines(TOLERANCE)), sample(task.view.lines))
    return Outcome(comparison.count(min_truth=MIN_TRUTH),
                   comparison.count(min_truth=MIN_TRUTH, subset=task.view.curved), seconds)


def measure(experiment: Experiment) -> str:
    """Write the section."""
    views = [view for lens in ('regular', 'wide', 'fisheye')
             for view in experiment.dataset.of_lens(lens, experiment.effort.per_lens // 2)]
    tasks = [Task(step, view) for step in STEPS for view in views]
    outcomes: dict[str, list[Outcome]] = {step: [] for step in STEPS}
    for task, outcome in each(count, tasks, 'ablation'):
        outcomes[task.step].append(outcome)
    rows = []
    for step, some in outcomes.items():
        every = sum((one.every for one in some), Counts()).figures()
        curved = sum((one.curved for one in some), Counts()).figures()
        rows.append((step, *map(number, (every.precision, every.recall, every.f_measure,
                                         every.whole, curved.whole, every.rms)),
                     every.detections,
                     significant(1e3 * float(np.median([one.seconds for one in some])))))
    return section(
        'What each step brings', f'{len(views)} images through regular, wide and fisheye lenses, '
        'at 2 px and 5 degrees; each step includes all steps above it. The first is plain '
        'numpy, the '
        'others are compiled; chains come from our own edge map; validation includes the '
        'suppression of parallel arcs. Time: median of the CPU time of single runs, in ms.',
        table(('step', 'P', 'R', 'F', 'whole', 'curved whole', 'rms', 'found', 'ms'), rows))
