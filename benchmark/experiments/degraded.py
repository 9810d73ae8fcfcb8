"""Loss of accuracy on dark, low-contrast, noisy and blurred copies of annotated images."""
from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from benchmark.datasets import View
from benchmark.experiment import Experiment
from benchmark.metrics import Comparison, Counts, sample
from benchmark.parallel import each
from benchmark.peers import load, OURS
from benchmark.report import number, section, table
import cv2
import numpy as np

MIN_TRUTH = 20.0            # px, shortest line that counts
GAMMA, GAIN, NOISE, BLUR = 2.2, 0.5, 10.0, 2.0
ORIGINAL = 'original'
OTHERS = 'pytlsd', 'lsdetect'       # LSD again


def _dark(gray: np.ndarray) -> np.ndarray:
    return np.rint(255 * (gray / 255) ** GAMMA).astype(np.uint8)


def _faint(gray: np.ndarray) -> np.ndarray:
    return np.rint(GAIN * gray).astype(np.uint8)


def _noisy(gray: np.ndarray) -> np.ndarray:
    noise = np.random.default_rng(0).normal(0, NOISE, gray.shape)
    return np.clip(np.rint(gray + noise), 0, 255).astype(np.uint8)


def _blurred(gray: np.ndarray) -> np.ndarray:
    return cv2.GaussianBlur(gray, (0, 0), BLUR)


COPIES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    ORIGINAL: np.copy, f'dark, gamma {GAMMA:g}': _dark, f'low contrast, gain {GAIN:g}': _faint,
    f'noise, {NOISE:g} grey levels': _noisy, f'blur, {BLUR:g} px': _blurred}
Sums = dict[tuple[str, str], Counts]        # by detector, copy


class Task(NamedTuple):
    """A copy of an image, for all detectors."""

    copy: str
    view: View
    names: tuple[str, ...]


def count(task: Task) -> dict[str, Counts]:
    """Return the counts of each detector."""
    gray, truth = COPIES[task.copy](task.view.gray), sample(task.view.lines)
    return {name: Comparison(sample(load(name)(gray)), truth).count(min_truth=MIN_TRUTH)
            for name in task.names}


def measure(experiment: Experiment) -> str:
    """Write the section."""
    views = experiment.dataset.of_levels(experiment.effort.per_level)
    names = tuple(name for name in experiment.peers if name not in OTHERS)
    tasks = [Task(copy, view, names) for view in views for copy in COPIES]
    sums: Sums = {}
    for task, counts in each(count, tasks, 'degraded copies'):
        for name in task.names:
            key = name, task.copy
            sums[key] = sums.get(key, Counts()) + counts[name]
    return section(
        'Degraded copies',
        f'F at 2 px and 5 degrees of {len(views)} images of all levels and of copies of them, '
        'all detectors with their settings for the originals; in brackets, as a share of F '
        'on the originals.', _table(sums, names),
        'Goal: our share is larger than that of every peer.',
        _marks(sums, names))


def share(sums: Sums, name: str, copy: str) -> float:
    """Return the F of a detector on a copy, over that on the original."""
    return (sums[name, copy].figures().f_measure / sums[name, ORIGINAL].figures().f_measure)


def _table(sums: Sums, names: tuple[str, ...]) -> str:
    rows = []
    for name in names:
        cells = [f'{number(sums[name, copy].figures().f_measure)} '
                 f'({number(share(sums, name, copy))})' for copy in COPIES]
        rows.append((load(name).title, *cells))
    return table(('detector', *COPIES), rows)


def _marks(sums: Sums, names: tuple[str, ...]) -> str:
    rows = []
    for copy in list(COPIES)[1:]:
        best = max((name for name in names if name != OURS),
                   key=lambda name: share(sums, name, copy))
        ours, theirs = share(sums, OURS, copy), share(sums, best, copy)
        rows.append((copy, load(best).title, number(theirs), number(ours),
                     'yes' if ours > theirs else 'no'))
    return table(('copy', 'best peer', 'its share', 'ours', 'reached'), rows)
