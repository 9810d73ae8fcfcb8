"""Accuracy of all detectors on all annotated images, and on chess boards."""
from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from benchmark.datasets import Board, View
from benchmark.experiment import Experiment
from benchmark.metrics import Comparison, Counts, sample
from benchmark.parallel import each
from benchmark.peers import load
from benchmark.report import number, section, table

MIN_TRUTH = 20.0            # px, shortest line that counts
MIN_CURVED = 60.0           # px, the same among curved lines
Sums = dict[tuple[str, str, str], Counts]       # by level, detector, rule
RULES = '2 px', '1 px', 'curved'
EXPLANATION = (
    'P, R, F: precision, recall and their harmonic mean, by length, at 2 px and 5 degrees; F1: F '
    'at 1 px; whole: share of the lines that one single detection covers to 75 %; fragments: '
    'detections on a line; duplicates: number of detections that cover a covered px; rms: '
    'distance of '
    'matched pieces from the annotation, px; curved whole: whole, of lines of 60 px or more '
    'that leave '
    'their chord by 2 px or more (through a lens without distortion: all of that length). '
    'Exact definitions: [metrics.py](metrics.py).')


def count_view(task: tuple[tuple[str, ...], View]) -> Sums:
    """Compare the detections of all detectors in an image with its annotation."""
    names, view = task
    gray, truth = view.gray, sample(view.lines)
    sums: Sums = {}
    for name in names:
        peer = load(name)
        comparison = Comparison(sample(peer(gray)), truth)
        counts = (comparison.count(2.0, min_truth=MIN_TRUTH),
                  comparison.count(1.0, min_truth=MIN_TRUTH),
                  comparison.count(2.0, min_truth=MIN_CURVED, subset=view.curved))
        sums.update({(view.level, peer.title, rule): c for rule, c in zip(RULES, counts)})
    return sums


def count_board(task: tuple[tuple[str, ...], Board]) -> Sums:
    """
    Compare the detections of all detectors on a chess board with the sides of its squares.

    Only the board is annotated: precision counts the pieces of detections within its outline.
    """
    names, board = task
    gray, truth = board.gray, sample(board.sides)
    sums: Sums = {}
    for name in names:
        peer = load(name)
        found = sample(peer(gray))
        sums['chess boards', peer.title, 'all'] = Comparison(found, truth).count()
        within = Comparison(found.inside(board.outline), truth).count()
        sums['chess boards', peer.title, 'within'] = within
    return sums


def measure(experiment: Experiment) -> str:
    """Write the section."""
    dataset, names = experiment.dataset, experiment.peers
    views = dataset.of_levels(experiment.effort.per_level)
    boards = dataset.boards[:experiment.effort.per_level]
    sums = _sum(each(count_view, [(names, view) for view in views], 'accuracy'))
    parts = [EXPLANATION, _views(sums)]
    if boards:
        sums = _sum(each(count_board, [(names, board) for board in boards], 'chess boards'))
        parts += [f'{len(boards)} chess boards, sides of their squares; precision counts '
                  'the detections within the outline of the board.', _boards(sums)]
    return section(f'Accuracy on {len(views)} annotated images', *parts)


def _sum(results: Iterable[tuple[Any, Sums]]) -> Sums:
    total: Sums = {}
    for _, sums in results:
        for key, counts in sums.items():
            total[key] = total.get(key, Counts()) + counts
    return total


def _views(sums: Sums) -> str:
    rows = []
    for level, title, rule in sums:
        if rule == RULES[0]:
            wide, narrow, curved = (sums[level, title, r].figures() for r in RULES)
            rows.append((
                title, level, *map(number, (wide.precision, wide.recall, wide.f_measure,
                                            narrow.f_measure, wide.whole, curved.whole)),
                *(number(value, 2) for value in (wide.fragments, wide.duplicates, wide.rms)),
                wide.detections))
    return table(('detector', 'level', 'P', 'R', 'F', 'F1', 'whole', 'curved whole', 'fragments',
                  'duplicates', 'rms', 'found'), rows)


def _boards(sums: Sums) -> str:
    rows = []
    for level, title, rule in sums:
        if rule == 'all':
            every, within = (sums[level, title, r].figures() for r in ('all', 'within'))
            rows.append((title, *map(number, (within.precision, every.recall, every.whole)),
                         number(every.fragments, 2), number(every.rms)))
    return table(('detector', 'P', 'R', 'whole', 'fragments', 'rms'), rows)
