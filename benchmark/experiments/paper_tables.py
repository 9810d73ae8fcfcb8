"""
The paper's Tables 1 and 2, measured again.

Reference: Qiao, Xu, Wang, Cheng, Dong, Quadratic Curve Fitting-Based Image Edge Line Segment
Detection, Appl. Sci. 2023, 13(15), 8654.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

from benchmark import plots, timing
from benchmark.datasets import Lens, LENSES, View
from benchmark.experiment import Experiment
from benchmark.metrics import (
    assign, Assignment, Comparison, Counts, sample, Samples, Tally)
from benchmark.parallel import each
from benchmark.peers import FLOOR, load, LSD, OURS, PAPER, TITLES
from benchmark.report import number, picture, section, significant, table
import numpy as np
from tqdm import tqdm

METHODS = LSD, PAPER, OURS
MIN_TRUTH = 20.0                # px, shortest line that counts
THRESHOLDS = 32                 # of the score
PRINTED = {LSD: (0.465, 0.381), PAPER: (0.878, 0.218)}     # precision, recall in the paper
NOTHING = math.nan, math.nan
PRINTED_SECONDS = {LSD: 18.90, PAPER: 0.70}
PRECISION_GOAL, RECALL_GOAL = 1.3, 1.5
WAYS = FOUND, AS_WHOLES, BY_LENGTH = 'lines found', 'lines as wholes', 'by length'
DEFINITION = (
    'TP: annotated lines of which at least 75 % is covered by detections (within 2 px and 5 '
    'degrees). FN: all other annotated lines. FP: detections of which less than 75 % lies on '
    'annotated lines. Lines shorter than 20 px and detections on them do not count. '
    'Precision is TP / (TP + FP), recall TP / (TP + FN). The paper does not define a '
    'true positive; in its table TP + FN is the same for both methods, so it counts '
    'annotated lines too.')
OTHER_WAYS = (
    'Three ways of counting over all images at once: *lines found*, as above; *lines as wholes*, '
    'where fragments, duplicates and joined lines are errors: a detection is a line if at least '
    '75 % of the detection lies on the line and it covers half of the line or more, each line is '
    'found once, and every other detection is a false positive; *by length*, shares of px.')


@dataclass(frozen=True)
class Found:
    """Detections of one method in one image: scores (nan: none), pieces, their lines."""

    scores: np.ndarray
    samples: Samples
    assignment: Assignment
    truth: Samples

    def wholes(self, threshold: float = -math.inf) -> Tally:
        """Count lines as wholes, without detections of a score below a threshold."""
        return self.assignment.tally(~(self.scores < threshold))

    def counts(self, threshold: float = -math.inf) -> Counts:
        """Return all other counts, with the same detections."""
        keep = (~(self.scores < threshold))[self.samples.line]
        s = self.samples
        kept = Samples(s.points[keep], s.tangents[keep], s.line[keep], s.weight[keep], s.count)
        return Comparison(kept, self.truth).count(min_truth=MIN_TRUTH)


def find(task: tuple[str, View]) -> Found:
    """Run one method on one image."""
    name, view = task
    peer = load(name)
    result = peer.detect(view.gray)
    lines = peer.polylines(result)
    scores = result.table['score'] if name == OURS else np.full(len(lines), math.nan)
    detections, truth = sample(lines), sample(view.lines)
    return Found(scores, detections, assign(Comparison(detections, truth), min_truth=MIN_TRUTH),
                 truth)


@dataclass(frozen=True)
class Curve:
    """Recall and precision (T,) for rising thresholds of the score."""

    recall: np.ndarray
    precision: np.ndarray

    def precision_at(self, recall: float) -> float:
        """Return the precision at a recall, nan outside the curve."""
        order = np.argsort(self.recall)
        if not self.recall.min() <= recall <= self.recall.max():
            return math.nan
        return float(np.interp(recall, self.recall[order], self.precision[order]))

    def recall_at(self, precision: float) -> float:
        """Return the highest recall at a precision, nan outside the curve."""
        best = math.nan
        points = list(zip(self.recall, self.precision))
        for (r, p), (s, q) in zip(points, points[1:] + points[-1:]):
            if p >= precision:
                best = np.fmax(best, r)
            if min(p, q) < precision <= max(p, q):
                best = np.fmax(best, r + (s - r) * (precision - p) / (q - p))
        return float(best)


def curves(images: Sequence[Found], title: str, steps: int) -> dict[str, Curve]:
    """Return precision against recall over the score, for each way of counting."""
    scores = np.concatenate([found.scores for found in images])
    points = [point(images, threshold) for threshold in tqdm(_thresholds(scores, steps), title)]
    return {way: Curve(*np.array([of[way] for of in points]).T) for way in WAYS}


def _thresholds(scores: np.ndarray, steps: int) -> np.ndarray:
    if not len(scores) or np.isnan(scores).any():
        return np.array([-math.inf])
    return np.r_[-math.inf, np.quantile(scores, np.linspace(0, 1, steps, endpoint=False)[1:])]


def point(images: Sequence[Found], threshold: float) -> dict[str, tuple[float, float]]:
    """Return recall and precision at a threshold, for each way of counting."""
    counts = sum((found.counts(threshold) for found in images), Counts())
    wholes = sum((found.wholes(threshold) for found in images), Tally())
    found, by_length = counts.tally(), counts.figures()
    return {FOUND: (found.recall, found.precision),
            AS_WHOLES: (wholes.recall, wholes.precision),
            BY_LENGTH: (by_length.recall, by_length.precision)}


def table_one(experiment: Experiment) -> str:
    """Measure Table 1: true and false positives on undistorted images with annotated lines."""
    views = experiment.dataset.of_lens('regular', experiment.effort.per_lens)
    tasks = [(name, view) for name in METHODS for view in views]
    found: dict[str, list[Found]] = {name: [] for name in METHODS}
    for (name, _), result in each(find, tasks, 'Table 1'):
        found[name].append(result)
    steps = max(4, THRESHOLDS // experiment.effort.every)
    of_methods = {name: curves(found[name], f'curve of {name}', steps) for name in METHODS}
    path = experiment.figures / 'precision_recall.png'
    plots.save(path, [_panel(way, of_methods) for way in WAYS])
    return section(
        'Table 1: undistorted images', DEFINITION, _images(views), _rows_one(views, found),
        OTHER_WAYS, _averages(found, of_methods),
        'Two goals, on the curve over our validation score (`score` in the table of arcs): '
        f'at the recall of LSD at least {PRECISION_GOAL} times its precision; at the precision '
        f'of the published method at least {RECALL_GOAL} times its recall.',
        _marks(of_methods), picture(path, experiment.output, 'Precision against recall'))


def _images(views: Sequence[View]) -> str:
    names = ', '.join(f'({chr(97 + i)}) {view.name}' for i, view in enumerate(views))
    return f'Images: {names}.'


def _rows_one(views: Sequence[View], found: dict[str, list[Found]]) -> str:
    rows = []
    for name in METHODS:
        tallies = [one.counts().tally() for one in found[name]]
        for text, field in (('TP', 'right'), ('FP', 'wrong'), ('FN', 'missed')):
            rows.append((TITLES[name], text, *(getattr(tally, field) for tally in tallies)))
    letters = [f'({chr(97 + i)})' for i in range(len(views))]
    return table(('method', 'number of', *letters), rows)


def _averages(found: dict[str, list[Found]], of_methods: dict[str, dict[str, Curve]]) -> str:
    rows = []
    for name in METHODS:
        tallies = [one.counts().tally() for one in found[name]]
        values = [np.nanmean([getattr(tally, field) for tally in tallies])
                  for field in ('precision', 'recall')]
        for way in WAYS:
            values += [of_methods[name][way].precision[0], of_methods[name][way].recall[0]]
        rows.append((TITLES[name], *map(number, (*values, *PRINTED.get(name, NOTHING)))))
    heads = 'mean over images', *WAYS, 'printed in the paper'
    return table(('method', *(f'{head}: {figure}' for head in heads for figure in 'PR')), rows)


def _panel(way: str, of_methods: dict[str, dict[str, Curve]]) -> plots.Panel:
    return plots.Panel(way, 'recall', 'precision', {
        name: (of[way].recall, of[way].precision) for name, of in of_methods.items()},
        limits=(0, 1))


def _marks(of_methods: dict[str, dict[str, Curve]]) -> str:
    rows = []
    for way in WAYS:
        ours, lsd, paper = (of_methods[name][way] for name in (OURS, LSD, PAPER))
        rows.append(_mark(way, f'precision at the recall {lsd.recall[0]:.3f} of LSD',
                          lsd.precision[0], ours.precision_at(lsd.recall[0]), PRECISION_GOAL,
                          f'our recall is {ours.recall.min():.3f} to {ours.recall.max():.3f}'))
        rows.append(_mark(way, f'recall at the precision {paper.precision[0]:.3f} as published',
                          paper.recall[0], ours.recall_at(paper.precision[0]), RECALL_GOAL,
                          f'our highest precision is {ours.precision.max():.3f}'))
    return table(('counted', 'goal', 'theirs', 'ours', 'ratio', 'wanted', 'reached'), rows)


def _mark(way: str, text: str, theirs: float, ours: float, goal: float,
          otherwise: str) -> tuple[str, ...]:
    times = ours / theirs if theirs else math.nan
    reached = otherwise if math.isnan(ours) else 'yes' if times >= goal else 'no'
    return way, text, number(theirs), number(ours), number(times, 2), f'>= {goal}', reached


def table_two(experiment: Experiment) -> str:
    """Measure Table 2: running time on images of regular, wide-angle and fisheye lenses."""
    views = {lens: experiment.dataset.of_lens(lens, experiment.effort.per_lens) for lens in LENSES}
    views = {lens: of_lens for lens, of_lens in views.items() if of_lens}
    images = {view.name: view.gray for of_lens in views.values() for view in of_lens}
    names = (*experiment.peers, PAPER, FLOOR)
    timings = timing.measure(images, names, experiment.effort.rounds, 'Table 2')
    return section(
        'Table 2: running time',
        'CPU time in ms, one thread, medians, all methods in turn in one process; a method '
        'that takes longer than 0.2 s runs once.',
        _rows_two(views, images, timings), _ratios(views, timings),
        'The paper compares two programs in the same language: LSD took '
        f'{PRINTED_SECONDS[LSD]:.2f} s on average, QF-LSD {PRINTED_SECONDS[PAPER]:.2f} s, "27 '
        'times faster". Here LSD is compiled; the published method is plain numpy, ours is '
        'compiled. So "LSD / ours" compares compiled programs, "published / ours" plain numpy '
        'with the compiled detector, and "LSD / published" a compiled program with numpy.',
        'All detectors on the same images; ratios to ours are geometric means, and the smallest:',
        _all(names, timings))


def _all(names: Sequence[str], timings: timing.Timings) -> str:
    rows = []
    for name in names:
        least = min(row[name].ms / row[OURS].ms for row in timings.values())
        rows.append((load(name).title,
                     significant(float(np.mean([row[name].ms for row in timings.values()]))),
                     significant(timing.ratio(timings, name, OURS)), significant(least)))
    return table(('detector', 'mean ms', 'over ours', 'least over ours'), rows)


def _rows_two(views: dict[Lens, list[View]], images: dict[str, np.ndarray],
              timings: timing.Timings) -> str:
    rows: list[tuple[str, ...]] = []
    for lens, of_lens in views.items():
        for view in of_lens:
            height, width = images[view.name].shape
            cells = [f'{significant(timings[view.name][name].ms)} / '
                     f'{timings[view.name][name].count}' for name in METHODS]
            rows.append((f'({chr(97 + len(rows))}) {view.name}', lens, f'{width}x{height}',
                         *cells))
    return table(('image', 'lens', 'size', *(f'{TITLES[name]}: ms / found' for name in METHODS)),
                 rows)


def _ratios(views: dict[Lens, list[View]], timings: timing.Timings) -> str:
    groups: dict[str, timing.Timings] = {
        lens: {view.name: timings[view.name] for view in of_lens}
        for lens, of_lens in views.items()}
    groups['all'] = timings
    rows = []
    for group, some in groups.items():
        means = [float(np.mean([row[name].ms for row in some.values()])) for name in METHODS]
        ratios = [timing.ratio(some, *pair)
                  for pair in ((LSD, OURS), (PAPER, OURS), (LSD, PAPER))]
        rows.append((group, *map(significant, means), *map(significant, ratios)))
    return table(('lens', *(f'{TITLES[name]}: mean ms' for name in METHODS), 'LSD / ours',
                  'published / ours', 'LSD / published'), rows)
