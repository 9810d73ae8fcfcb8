"""
The open parameters of the published method, on a grid: which give the best F.

The images are none of those of Table 1, so that the table compares with parameters that were
chosen for the method, not for the table.
"""
from __future__ import annotations

import dataclasses
import itertools
from typing import NamedTuple
from unittest import mock

from benchmark.datasets import View
from benchmark.experiment import Experiment
from benchmark.experiments import published_search
from benchmark.metrics import Comparison, Counts, sample
from benchmark.parallel import each
from benchmark.peers import published, TOLERANCE
from benchmark.report import number, section, table
from qflsd_ros.core import paper, Parameters

MIN_TRUTH = 20.0                            # px, as in Table 1
EPSILON = 20.0, 100.0, 500.0, 2000.0, 10000.0, 50000.0      # px^2
SHORTEST = 15.0, 25.0, 40.0, 60.0            # px, min_length
HIGH = 12.5, 25.0, 37.5, 50.0                # grey levels, upper threshold of Canny
LOW = 1 / 3                                 # of the upper threshold
BEST = 10                                   # rows of the table
EXPLANATION = (
    'The paper leaves open epsilon, the shortest segment and the thresholds of Canny. All '
    f'combinations of epsilon {", ".join(f"{e:g}" for e in EPSILON)} px^2, shortest segment '
    f'{", ".join(f"{s:g}" for s in SHORTEST)} px and upper threshold '
    f'{", ".join(f"{h:g}" for h in HIGH)} grey levels (the lower one is a third) are measured '
    'at 2 px and 5 degrees, with a compiled copy of the search. The best F is that of '
    '`config/paper.yaml`.')


class Task(NamedTuple):
    """Parameters of the published method, and an image."""

    parameters: Parameters
    view: View


def grid() -> list[Parameters]:
    """Return all combinations of the open parameters."""
    return [dataclasses.replace(published(), paper_epsilon=epsilon, min_length=shortest,
                                contrast_high=high, contrast_low=LOW * high)
            for epsilon, shortest, high in itertools.product(EPSILON, SHORTEST, HIGH)]


def held_out(experiment: Experiment) -> list[View]:
    """Return rendered images, and those regular ones of the data set that Table 1 does not use."""
    used, some = experiment.effort.per_lens, max(1, experiment.effort.per_lens // 2)
    regular = [view for view in experiment.dataset.views if view.lens == 'regular']
    return regular[used::max(1, (len(regular) - used) // some)][:some] \
        + experiment.rendered.of_lens('wide', some)


def count(task: Task) -> Counts:
    """Compare the segments of an image with its lines."""
    with mock.patch.object(paper, 'segments', published_search.segments):
        arcs = paper.detect(task.view.gray, task.parameters)
    found = sample(arcs.polylines(TOLERANCE))
    return Comparison(found, sample(task.view.lines)).count(min_truth=MIN_TRUTH)


def measure(experiment: Experiment) -> str:
    """Write the section."""
    views, choices = held_out(experiment), grid()[::experiment.effort.every]
    counts = {parameters: Counts() for parameters in (published(), *choices)}
    tasks = [Task(parameters, view) for parameters in counts for view in views]
    for task, found in each(count, tasks, 'paper_grid'):
        counts[task.parameters] += found
    order = sorted(choices, key=lambda parameters: -counts[parameters].figures().f_measure)
    rows = [('best', order[0]), *(('', one) for one in order[1:BEST]), ('worst', order[-1]),
            ('config/paper.yaml', published())]
    names = ', '.join(view.name for view in views)
    return section(
        'Open parameters of the published method', EXPLANATION, f'Images: {names}.',
        table(('', 'epsilon', 'shortest', 'upper threshold', 'P', 'R', 'F', 'whole'),
              [(name, *cells(one, counts[one])) for name, one in rows]))


def cells(parameters: Parameters, counts: Counts) -> tuple[str, ...]:
    """Return the open parameters and what they give."""
    figures = counts.figures()
    values = parameters.paper_epsilon, parameters.min_length, parameters.contrast_high
    return (*(f'{value:g}' for value in values),
            *map(number, (figures.precision, figures.recall, figures.f_measure, figures.whole)))
