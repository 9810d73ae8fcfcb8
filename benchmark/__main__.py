"""
Measure everything, and write the report.

One command: ``script/benchmark --data DIR``.
"""
from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
import shutil
import sys
import time

from benchmark import (
    accuracy, exactness, node, paper_tables, peers, plates, repeatability, report, robustness,
    speed, stages)
from benchmark.datasets import Dataset, DatasetError
from benchmark.experiment import Effort, Experiment, QUICK
from benchmark.rendered import write
from tqdm import tqdm

# In the order of the report.
EXPERIMENTS = {
    'table1': paper_tables.table_one, 'table2': paper_tables.table_two,
    'plates': plates.measure, 'accuracy': accuracy.measure, 'exactness': exactness.measure,
    'speed': speed.measure, 'stages': stages.measure, 'node': node.measure,
    'robustness': robustness.measure, 'repeatability': repeatability.measure}
RESULTS = 'RESULTS.md'
RENDERED = 'rendered'
USAGE = 2               # exit code


def parse(args: Sequence[str] | None) -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog='script/benchmark', description='Measures the detector side by side with its peers '
        f'and writes {RESULTS} and its figures.')
    parser.add_argument('--data', type=Path, metavar='DIR', help='images with annotated lines; '
                        'benchmark/README.md has the format (default: rendered scenes)')
    parser.add_argument('--sequence', type=Path, metavar='DIR', action='append', default=[],
                        help='folder of frames for repeatability; can be given several times')
    parser.add_argument('--output', type=Path, metavar='DIR', default=report.ROOT / 'benchmark',
                        help='folder of the report (default: benchmark)')
    parser.add_argument('--quick', action='store_true',
                        help='a small part of it all, to see that it works')
    parser.add_argument('--only', metavar='NAME', nargs='+', choices=EXPERIMENTS,
                        default=list(EXPERIMENTS),
                        help=f'only these experiments, of {", ".join(EXPERIMENTS)}')
    parser.add_argument('--peer', metavar='NAME=MODULE:FUNCTION', action='append', default=[],
                        help='another detector; benchmark/README.md says what it must do')
    parser.add_argument('--figures-from-data', action='store_true',
                        help=f'plates of the data set as well, in {plates.PHOTOGRAPHS}/ of the '
                        'output folder; mind the licence of the images')
    return parser.parse_args(args)


def prepare(arguments: argparse.Namespace) -> Experiment:
    """Return what the experiments need; scenes are rendered now."""
    output: Path = arguments.output
    for folder in output / RENDERED, output / 'figures':
        if len(arguments.only) == len(EXPERIMENTS):
            shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)
    for folder in arguments.sequence:
        if not folder.is_dir():
            raise DatasetError(f'--sequence {folder}: there is no such folder')
    dataset = Dataset.read(arguments.data) if arguments.data else None
    effort = QUICK if arguments.quick else Effort()
    rendered = write(output / RENDERED, effort.shape, effort.per_lens)
    names = peers.available()
    for name in arguments.peer:
        peers.load(name)
    return Experiment(dataset or rendered, rendered, tuple(arguments.sequence),
                      (*names[:-1], *arguments.peer, names[-1]), output, effort,
                      arguments.figures_from_data)


def main(args: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    arguments = parse(args)
    start = time.monotonic()
    try:
        experiment = prepare(arguments)
    except (DatasetError, ValueError, ImportError, AttributeError) as error:
        print(f'benchmark: {error}', file=sys.stderr)
        return USAGE
    sections = []
    for name in tqdm(arguments.only, 'experiments'):
        sections.append(EXPERIMENTS[name](experiment))
    given = sys.argv[1:] if args is None else args
    command = ' '.join(['script/benchmark', *map(str, given)])
    kind = 'A quick run, to see that it works: no figures to quote.' if arguments.quick else ''
    parts = ['# Benchmark\n', kind and f'{kind}\n', report.conditions(command), *sections,
             f'The run took {(time.monotonic() - start) / 60:.1f} minutes.\n']
    path = experiment.output / RESULTS
    path.write_text('\n'.join(filter(None, parts)), encoding='utf-8')
    print(f'The report is {path}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
