"""Precision, recall and whole against noise, blur, contrast, distortion and compression."""
from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import NamedTuple

from benchmark import plots
from benchmark.experiment import Experiment
from benchmark.metrics import Comparison, Counts, sample
from benchmark.parallel import each
from benchmark.peers import EDLINES, load, LSD, OURS, TITLES
from benchmark.report import number, picture, section, table
from benchmark.scenes.rendered import room, TURN
import cv2
import numpy as np

MIN_TRUTH = 20.0        # px
FIGURES = {'precision': 'precision', 'recall': 'recall', 'whole': 'whole'}


@dataclass(frozen=True)
class Condition:
    """Conditions of an image; blur, contrast, noise and compression apply in this order."""

    noise: float = 2.0          # grey levels
    blur: float = 0.0           # px, standard deviation
    contrast: float = 1.0       # share of the scene's own
    lam: float = -0.25
    quality: float = 100        # of JPEG, whole; 100: no compression

    def take(self, clean: np.ndarray, seed: int) -> np.ndarray:
        """Return a clean image under this condition, (H, W) uint8."""
        image: np.ndarray = clean.astype(np.float32)
        if self.blur > 0:
            image = cv2.GaussianBlur(image, (0, 0), self.blur)
        image = 128 + self.contrast * (image - 128)
        image += np.random.default_rng(seed).normal(0, self.noise, image.shape)
        image = np.clip(np.rint(image), 0, 255).astype(np.uint8)
        if self.quality < 100:
            _, data = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, int(self.quality)])
            return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE))
        return image


AXES = {
    'noise': ('noise, grey levels', (0.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0)),
    'blur': ('blur, px', (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)),
    'contrast': ('contrast', (1.0, 0.7, 0.5, 0.35, 0.2, 0.1)),
    'lam': ('lambda', (0.0, -0.1, -0.25, -0.4, -0.6, -0.8, -1.0)),
    'quality': ('JPEG quality', (100, 90, 75, 50, 30, 20, 10))}


class Task(NamedTuple):
    """A view of the room under a condition, for all detectors."""

    axis: str
    condition: Condition
    number: int
    shape: tuple[int, int]
    names: tuple[str, ...]


def count(task: Task) -> dict[str, Counts]:
    """Return the counts of each detector."""
    view = room(task.number, task.condition.lam, task.shape, noise=0.0)
    gray, truth = task.condition.take(view.gray, task.number), sample(view.lines)
    return {name: Comparison(sample(load(name)(gray)), truth).count(min_truth=MIN_TRUTH)
            for name in task.names}


def measure(experiment: Experiment) -> str:
    """Write the section."""
    effort = experiment.effort
    names = tuple(name for name in (LSD, EDLINES, OURS) if name in experiment.peers)
    numbers = range(0, TURN, TURN // effort.viewpoints)
    tasks = [Task(axis, Condition(**{axis: value}), number, effort.shape, names)
             for axis, (_, values) in AXES.items() for value in values[::effort.every]
             for number in numbers]
    sums: dict[tuple[str, float, str], Counts] = {}
    for task, counts in each(count, tasks, 'robustness'):
        for name in names:
            key = task.axis, asdict(task.condition)[task.axis], name
            sums[key] = sums.get(key, Counts()) + counts[name]
    path = experiment.figures / 'robustness.png'
    plots.save(path, [_panel(sums, axis, figure, names) for axis in AXES for figure in FIGURES])
    return section(
        'Robustness', f'The rendered room ({len(numbers)} views of it), lambda -0.25, noise 2 '
        'grey levels, one thing changed at a time; edges with a step of 5 grey levels or more '
        'count, at 2 px and 5 degrees, from 20 px on.',
        picture(path, experiment.output, 'Precision, recall and whole under bad conditions'),
        _table(sums, names))


def _panel(sums: dict[tuple[str, float, str], Counts], axis: str, figure: str,
           names: tuple[str, ...]) -> plots.Panel:
    series: dict[str, tuple[plots.Values, plots.Values]] = {}
    for name in names:
        points = [(value, getattr(counts.figures(), figure))
                  for (of, value, peer), counts in sums.items() if (of, peer) == (axis, name)]
        series[name] = [x for x, _ in points], [y for _, y in points]
    return plots.Panel('', AXES[axis][0], figure, series, limits=(0, 1))


def _table(sums: dict[tuple[str, float, str], Counts], names: tuple[str, ...]) -> str:
    rows = []
    for axis, (text, _) in AXES.items():
        for value in dict.fromkeys(v for of, v, _ in sums if of == axis):
            figures = [sums[axis, value, name].figures() for name in names]
            rows.append((f'{text} {value:g}', *(
                ' / '.join(number(getattr(f, figure)) for figure in FIGURES) for f in figures)))
    return table(('condition', *(f'{TITLES[name]}: P / R / whole' for name in names)), rows)
