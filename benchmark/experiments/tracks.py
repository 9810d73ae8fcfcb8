"""Identity of lines over frames: a photograph seen by a turning camera, and a walk in the room."""
from __future__ import annotations

from itertools import islice
from typing import NamedTuple

from benchmark.datasets import Lens
from benchmark.experiment import Experiment
from benchmark.identity import LAGS, Lives, lives, over_frames, Sums
from benchmark.metrics import ratio
from benchmark.parallel import each
from benchmark.report import number, section, table
from benchmark.scenes.return_walk import ReturnWalk
from benchmark.scenes.turning import Turning
from benchmark.timing import run
from benchmark.trackers import available, begin, title
import numpy as np
from tqdm import tqdm

SPEEDS = {'slow': 1.0, 'fast': 3.0}
LENSES: tuple[Lens, ...] = ('regular', 'fisheye')
LAMBDAS = 0.0, -0.3, -0.6
STARTS = 0, 300, 600, 900       # quarters of the room's path
WARM = 5                        # frames that do not count for the time
ROOM = 'room, lambda '


class Task(NamedTuple):
    """One tracker on one sequence; several sequences of one name are summed."""

    name: str
    sequence: str
    frames: Turning | ReturnWalk


class Totals(NamedTuple):
    """The sums of one tracker over the sequences of one name."""

    by_lag: dict[int, Sums]
    lives: Lives


def follow(task: Task) -> Totals:
    """Run a tracker over a sequence, and judge its identities."""
    tracker = begin(task.name)
    found = [tracker(task.frames.frame(i)) for i in range(len(task.frames))]
    return Totals(over_frames(task.frames, found), lives(found))


def sequences(experiment: Experiment) -> list[tuple[str, Turning | ReturnWalk]]:
    """Return the sequences with their names."""
    effort = experiment.effort
    frames, made = 2 * effort.frames, []
    for lens in LENSES:
        for view in experiment.dataset.of_lens(lens, effort.viewpoints + 1):
            if view.lam is not None:
                made += [(f'{lens}, {speed}', Turning(view.gray, view.lam, frames, factor))
                         for speed, factor in SPEEDS.items()]
    starts = islice(STARTS, effort.viewpoints + 1)
    walks = [(f'{ROOM}{lam:g}', ReturnWalk(effort.shape, lam, frames, start))
             for start in starts for lam in LAMBDAS]
    return sorted([*made, *walks], key=lambda pair: pair[0])


def milliseconds(experiment: Experiment) -> dict[str, tuple[float, float]]:
    """Return the time a frame of each tracker, ms, and how much of it is beyond detection."""
    walk = ReturnWalk(experiment.effort.shape, LAMBDAS[1], experiment.effort.frames + WARM, 0)
    images = [walk.frame(i) for i in range(len(walk))]
    trackers = {name: begin(name) for name in available()}
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in trackers}
    for image in tqdm(images, 'time of trackers'):
        for name, tracker in trackers.items():
            times[name].append((run(tracker, image)[0], run(tracker.bare, image)[0]))
    found = {}
    for name, pairs in times.items():
        whole, bare = np.mean(pairs[min(WARM, len(pairs) - 1):], axis=0) * 1e3
        found[name] = float(whole), float(whole - bare)
    return found


def measure(experiment: Experiment) -> str:
    """Write the section."""
    tasks = [Task(name, sequence, frames) for sequence, frames in sequences(experiment)
             for name in available()]
    totals: dict[tuple[str, str], Totals] = {}
    for task, found in each(follow, tasks, 'tracks'):
        key = task.sequence, task.name
        if key in totals:
            before = totals[key]
            found = Totals({lag: before.by_lag[lag].plus(found.by_lag[lag]) for lag in LAGS},
                           before.lives.plus(found.lives))
        totals[key] = found
    columns = [f'{figure}@{lag}' for lag in LAGS for figure in ('found', 'kept', 'right')]
    rows = [(sequence, title(name), *_figures(found))
            for (sequence, name), found in totals.items()]
    times = [(title(name), number(whole, 1), number(beyond, 1))
             for name, (whole, beyond) in milliseconds(experiment).items()]
    return section(
        'Tracks',
        'Identity of lines over frames; `identity.py` defines the figures. *regular*, *fisheye*: '
        'images seen by a camera that turns up to 1 degree a frame, or three times that; *room*: '
        'a camera that walks and turns in the rendered room, 0.6 degrees a frame, forth and back. '
        'Goal in the room: kept@10 at least 0.95, right at least 0.99.',
        table(('sequence', 'tracker', *columns, 'life', 'often', 'twice'), rows),
        'CPU time, ms a frame, mean; the room at '
        f'{experiment.effort.shape[1]} x {experiment.effort.shape[0]}.',
        table(('tracker', 'ms', 'beyond detection'), times))


def _figures(found: Totals) -> list[str]:
    """Return the cells of a row."""
    cells = [number(value, 3) for lag in LAGS for value in found.by_lag[lag].figures]
    life = found.lives
    return [*cells, number(ratio(life.lines, life.identities), 1),
            number(ratio(life.often, life.lines)), number(ratio(life.twice, life.lines), 3)]
