"""Accuracy on rendered scenes with exact truth, finer than annotations by hand."""
from __future__ import annotations

from typing import NamedTuple

from benchmark.experiment import Experiment
from benchmark.metrics import Comparison, sample
from benchmark.parallel import each
from benchmark.peers import load
from benchmark.report import number, section, table
from benchmark.scenes import planes
from benchmark.scenes.lenses import EquidistantLens, Lens
from benchmark.scenes.rendered import FIELD
from qflsd_ros.core import DivisionModel

NOISE = 2.0                         # grey levels
LAMBDAS = 0.0, -0.1, -0.25, -0.5
TOLERANCE, MIN_TRUTH = 1.5, 20.0    # px
SCENES = {'board': planes.board, 'bars': planes.bars}


class Task(NamedTuple):
    """A scene through a lens, for all detectors."""

    scene: str
    lens: str
    model: Lens
    names: tuple[str, ...]


def rows(task: Task) -> list[tuple[object, ...]]:
    """Return a row of the table for every detector."""
    scene = SCENES[task.scene](task.model)
    gray, truth = planes.render(scene, task.model, NOISE), planes.lines(scene, task.model)
    result: list[tuple[object, ...]] = []
    for name in task.names:
        peer = load(name)
        counts = Comparison(sample(peer(gray)), sample(truth)).count(TOLERANCE,
                                                                     min_truth=MIN_TRUTH)
        figures = counts.figures()
        pieces = 1000 * counts.correct / counts.covered if counts.covered else float('nan')
        result.append((peer.title, task.scene, task.lens, number(figures.precision),
                       number(figures.recall), number(figures.whole), number(pieces, 1),
                       number(1000 * counts.lines / counts.truth, 1), number(figures.rms)))
    return result


def measure(experiment: Experiment) -> str:
    """Write the section."""
    shape = experiment.effort.shape
    lenses: dict[str, Lens] = {f'lambda {lam:g}': DivisionModel(lam, shape) for lam in LAMBDAS}
    lenses[f'equidistant, {FIELD:g} degrees'] = EquidistantLens(FIELD, shape)
    tasks = [Task(scene, lens, model, experiment.peers) for scene in SCENES
             for lens, model in list(lenses.items())[::-experiment.effort.every]]
    results = [row for _, some in each(rows, tasks, 'exact scenes') for row in some]
    height, width = shape
    return section(
        'Exactness on rendered scenes',
        f'{width}x{height} px, noise {NOISE:g} grey levels, matched at {TOLERANCE} px and 5 '
        'degrees. *board*: a line runs across all squares of a checkerboard and changes its '
        'polarity at every corner; *bars*: sides of rectangles of contrast 25 to 90 grey levels. '
        'pieces: correct detections on 1000 px of covered truth; ideal: lines on 1000 px of '
        'truth; rms: px.',
        table(('detector', 'scene', 'lens', 'P', 'R', 'whole', 'pieces', 'ideal', 'rms'),
              results))
