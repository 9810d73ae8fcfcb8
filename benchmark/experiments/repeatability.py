"""Repeatability: the share of detections that are found again in the next frame."""
from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from benchmark.datasets import read_gray
from benchmark.experiment import Experiment
from benchmark.metrics import Comparison, Counts, sample
from benchmark.parallel import each
from benchmark.peers import load
from benchmark.report import number, section, table
from benchmark.scenes import planes
import numpy as np
from qflsd_ros.core import DivisionModel
from qflsd_ros.sources.files import IMAGE_SUFFIXES

MIN_LENGTH = 20.0           # px, of detections that are to be found again
RENDERED = 'rendered bars'
NOISE = 4.0                 # grey levels


class Task(NamedTuple):
    """One detector on one sequence."""

    name: str
    sequence: str
    frames: int
    shape: tuple[int, int]      # of a rendered sequence


def repeat(task: Task) -> tuple[Counts, list[int]]:
    """Compare each frame with the one before it; return also the number of lines of each."""
    peer = load(task.name)
    found = [sample(peer(gray)) for gray in frames(task)]
    pairs = (Comparison(after, before).count(min_truth=MIN_LENGTH)
             for before, after in zip(found, found[1:]))
    return sum(pairs, Counts()), [one.count for one in found]


def sequences(folder: Path) -> list[Path]:
    """Return the folders of images in a folder, sorted; none if the folder does not exist."""
    return sorted({path.parent for path in folder.glob('*/*')
                   if path.suffix.lower() in IMAGE_SUFFIXES})


def frames(task: Task) -> list[np.ndarray]:
    """Return the frames of a folder in order of their names, or those of a still scene."""
    if task.sequence == RENDERED:
        lens = DivisionModel(-0.25, task.shape)
        scene = planes.bars(lens)
        clean = planes.render(scene, lens).astype(float)
        random = np.random.default_rng(0)
        return [np.clip(np.rint(clean + random.normal(0, NOISE, clean.shape)), 0, 255).astype(
            np.uint8) for _ in range(task.frames)]
    paths = sorted(path for path in Path(task.sequence).iterdir()
                   if path.suffix.lower() in IMAGE_SUFFIXES)
    return [read_gray(path) for path in paths[:task.frames]]


def measure(experiment: Experiment) -> str:
    """Write the section."""
    sequences = (RENDERED, *map(str, experiment.sequences))
    tasks = [Task(name, sequence, experiment.effort.frames, experiment.effort.shape)
             for sequence in sequences for name in experiment.peers]
    rows = []
    for task, (counts, numbers) in each(repeat, tasks, 'repeatability'):
        figures = counts.figures()
        rows.append((load(task.name).title, Path(task.sequence).name, len(numbers),
                     number(figures.recall), number(figures.whole), number(figures.rms),
                     number(float(np.mean(numbers)), 0), number(float(np.std(numbers)), 1)))
    return section(
        'Repeatability',
        f'*again*: share, by length, of the detections in a frame (from {MIN_LENGTH:g} px on) '
        'that are found in the next one, within 2 px and 5 degrees; *whole*: share of the '
        'detections that one single detection of the next frame covers to 75 %; rms: distance '
        f'between both, px. *{RENDERED}*: a still scene with fresh noise of {NOISE:g} grey levels '
        'in each frame. Where camera or objects move, motion counts as failure.',
        table(('detector', 'sequence', 'frames', 'again', 'whole', 'rms', 'mean number',
               'standard deviation'), rows))
