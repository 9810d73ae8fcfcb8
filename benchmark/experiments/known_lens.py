"""The gain by a known lens: the same images, detected without the lens and with it."""
from __future__ import annotations

from typing import NamedTuple

from benchmark.datasets import BENT, View
from benchmark.experiment import Experiment
from benchmark.experiments.accuracy import MIN_CURVED, MIN_TRUTH
from benchmark.metrics import Comparison, Counts, Figures, ratio, sample, Samples
from benchmark.parallel import each
from benchmark.peers import TOLERANCE
from benchmark.report import number, table
from benchmark.timing import run
import numpy as np
from qflsd_ros.core import Arcs, Detector, DivisionModel, estimate_distortion

SHORT = 80.0            # px, length below which edge points hardly determine an arc's curvature
ROUNDS = 7              # runs of which the median CPU time is taken
# By what the report calls it: whether curved lines alone count, and the figure.
FIGURES = {'P': (False, 'precision'), 'R': (False, 'recall'), 'F': (False, 'f_measure'),
           'whole': (False, 'whole'), 'curved whole': (True, 'whole'),
           'fragments': (False, 'fragments')}
EXPLANATION = (
    'Annotated images, lens unknown / estimated from the arcs of the same image, at 2 px and 5 '
    'degrees; *estimated*: images with an estimate, the others are detected without; curved '
    'whole: whole, of lines '
    f'of {MIN_CURVED:g} px or more that leave their chord by {BENT:g} px or more (through a '
    'lens without distortion: all of that length); CPU time: of detection with the lens over '
    'that without.')


class Found(NamedTuple):
    """Counts of all lines of an image, and of its curved lines."""

    every: Counts
    curved: Counts


class Used(NamedTuple):
    """Counts without the lens and with it, and CPU times in s; 0 without an estimate."""

    unknown: Found
    known: Found
    seconds: float
    seconds_known: float


def sagitta_errors(arcs: Arcs, lens: DivisionModel) -> np.ndarray:
    """Return errors (M,) px of the sagitta of short arcs, against images of straight edges."""
    rows = arcs.table[arcs.table['length'] < SHORT]
    chord = rows['end'] - rows['start']
    normals = np.column_stack([chord[:, 1], -chord[:, 0]]) / np.hypot(*chord.T)[:, None]
    off = rows['curvature'] - lens.curvature(rows['middle'], normals)
    return np.abs(off) * rows['length'] ** 2 / 8


def use(view: View) -> Used:
    """Detect the lines of an image, and again with the lens estimated from them."""
    gray, truth, detector = view.gray, sample(view.lines), Detector()
    arcs = detector.detect(gray)
    unknown, estimate = _found(arcs, truth, view), estimate_distortion([arcs], gray.shape)
    if estimate is None:
        return Used(unknown, unknown, 0.0, 0.0)
    known = _found(detector.detect(gray, lens=estimate.model), truth, view)
    # In turn: a slow phase of the machine slows both.
    times = [[run(detector.detect, gray, None, lens)[0] for lens in (None, estimate.model)]
             for _ in range(ROUNDS)]
    return Used(unknown, known, *np.median(times, axis=0).tolist())


def _found(arcs: Arcs, truth: Samples, view: View) -> Found:
    comparison = Comparison(sample(arcs.polylines(TOLERANCE)), truth)
    return Found(comparison.count(min_truth=MIN_TRUTH),
                 comparison.count(min_truth=MIN_CURVED, subset=view.curved))


def measure(experiment: Experiment) -> str:
    """Return a table with a row for each level of the data set."""
    views = experiment.dataset.of_levels(experiment.effort.per_level)
    levels: dict[str, list[Used]] = {view.level: [] for view in views}
    for view, used in each(use, views, 'known lens'):
        levels[view.level].append(used)
    return table(('level', 'images', 'estimated', *FIGURES, 'CPU time'),
                 [(level, len(images), sum(used.seconds > 0 for used in images),
                   *_cells(images)) for level, images in levels.items()])


def _cells(images: list[Used]) -> list[str]:
    """Return all figures, and the ratio of CPU times."""
    unknown, known = _sum([used.unknown for used in images]), _sum([used.known for used in images])
    pairs = [(getattr(unknown[curved], name), getattr(known[curved], name))
             for curved, name in FIGURES.values()]
    seconds = sum(used.seconds for used in images)
    return [*(f'{number(one)} / {number(other)}' for one, other in pairs),
            number(ratio(sum(used.seconds_known for used in images), seconds), 2)]


def _sum(found: list[Found]) -> tuple[Figures, Figures]:
    every, curved = zip(*found)
    return sum(every, Counts()).figures(), sum(curved, Counts()).figures()
