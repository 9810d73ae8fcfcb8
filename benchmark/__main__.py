"""The command ``script/benchmark``: run the experiments, and write the report."""
from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
import shutil
import sys
import time

from benchmark import peers, quote, report
from benchmark.datasets import Dataset, DatasetError
from benchmark.experiment import Effort, Experiment, QUICK
from benchmark.experiments import (
    ablation, accuracy, attitude, cameras, degraded, exactness, false_alarms, growth, lens,
    line_features, mapping, memory, node, overhead, paper_grid, paper_tables, plates,
    repeatability, robustness, sameness, sensitivity, speed, stages, start, tracks)
from benchmark.scenes.rendered import write
from tqdm import tqdm

# In the order of the report.
EXPERIMENTS: dict[str, Callable[[Experiment], str]] = {
    'table1': paper_tables.table_one, 'table2': paper_tables.table_two,
    'plates': plates.measure, 'accuracy': accuracy.measure, 'ablation': ablation.measure,
    'degraded': degraded.measure, 'robustness': robustness.measure,
    'exactness': exactness.measure, 'false_alarms': false_alarms.measure, 'lens': lens.measure,
    'attitude': attitude.measure,
    'repeatability': repeatability.measure, 'tracks': tracks.measure,
    'line_features': line_features.measure,
    'sameness': sameness.measure, 'speed': speed.measure, 'growth': growth.measure,
    'stages': stages.measure, 'node': node.measure,
    'overhead': overhead.measure, 'memory': memory.measure, 'start': start.measure,
    'cameras': cameras.measure, 'mapping': mapping.measure}
# Only by name: they take minutes, and change only when a constant of the core, or the published
# method, does.
BY_NAME = {'sensitivity': sensitivity.measure, 'paper_grid': paper_grid.measure}
PARTIAL = 'partial.md'  # the report of some experiments, beside that of a run of all of them
RENDERED = 'rendered'
SEQUENCES, ATTITUDES = 'seq', 'attitude'
USAGE = 2               # exit code


def parse(args: Sequence[str] | None) -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog='script/benchmark', description='Measures the detector side by side with its peers '
        f'and writes {quote.RESULTS.name} and its figures.')
    parser.add_argument('--data', type=Path, metavar='DIR', help='images with annotated lines; '
                        'benchmark/README.md has the format (default: rendered scenes)')
    parser.add_argument('--sequence', type=Path, metavar='DIR', action='append', default=[],
                        help='folder of frames for repeatability; can be given several times '
                        f'(default: those in the folder {SEQUENCES} beside that of --data)')
    parser.add_argument('--output', type=Path, metavar='DIR', default=quote.RESULTS.parent,
                        help='folder of the report (default: benchmark)')
    parser.add_argument('--quick', action='store_true',
                        help='a small part of each experiment, to check that it works')
    parser.add_argument('--only', metavar='NAME', nargs='+', choices=EXPERIMENTS | BY_NAME,
                        default=list(EXPERIMENTS),
                        help=f'only these experiments, of {", ".join(EXPERIMENTS | BY_NAME)}; the '
                        f'report is {PARTIAL}. {", ".join(BY_NAME)}: not run by default, quoted '
                        f'in {quote.DESIGN.relative_to(report.ROOT)}')
    parser.add_argument('--peer', metavar='NAME=MODULE:FUNCTION', action='append', default=[],
                        help='another detector; benchmark/README.md has its interface')
    parser.add_argument('--figures-from-data', action='store_true',
                        help=f'plates of the data set as well, in {plates.PHOTOGRAPHS}/ of the '
                        'output folder; mind the licence of the images')
    return parser.parse_args(args)


def prepare(arguments: argparse.Namespace) -> Experiment:
    """Return the input of the experiments; this renders the scenes."""
    output: Path = arguments.output
    for folder in output / RENDERED, output / 'figures':
        if is_whole(arguments):
            shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)
    for folder in arguments.sequence:
        if not folder.is_dir():
            raise DatasetError(f'--sequence {folder}: must be an existing folder')
    dataset = Dataset.read(arguments.data) if arguments.data else None
    sequences = arguments.sequence
    if dataset and not sequences:
        sequences = repeatability.sequences(arguments.data.resolve().parent / SEQUENCES)
    attitudes = arguments.data and arguments.data.resolve().parent / ATTITUDES
    effort = QUICK if arguments.quick else Effort()
    rendered = write(output / RENDERED, effort.shape, effort.per_lens)
    names = peers.available()
    for name in arguments.peer:
        peers.load(name)
    return Experiment(dataset or rendered, rendered, tuple(sequences),
                      attitudes if attitudes and attitudes.is_dir() else None,
                      (*names[:-1], *arguments.peer, names[-1]), output, effort,
                      arguments.figures_from_data)


def is_whole(arguments: argparse.Namespace) -> bool:
    """Return whether all experiments of the report are run."""
    return list(arguments.only) == list(EXPERIMENTS)


def main(args: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    arguments = parse(args)
    try:
        experiment = prepare(arguments)
    except (DatasetError, ValueError, ImportError, AttributeError) as error:
        print(f'benchmark: {error}', file=sys.stderr)
        return USAGE
    sections, minutes = {}, {}
    for name in tqdm(arguments.only, 'experiments'):
        begin = time.monotonic()
        sections[name] = (EXPERIMENTS | BY_NAME)[name](experiment)
        minutes[name] = (time.monotonic() - begin) / 60
    given = sys.argv[1:] if args is None else args
    command = ' '.join(['script/benchmark', *map(str, given)])
    kind = 'A quick run: it checks that all works, its figures mean nothing.\n' * arguments.quick
    text = '\n'.join(filter(None, [
        '# Benchmark\n', kind, report.conditions(command), *sections.values(),
        f'The run took {sum(minutes.values()):.1f} minutes: '
        + ', '.join(f'{name} {took:.1f}' for name, took in minutes.items()) + '.\n']))
    path = experiment.output / (quote.RESULTS.name if is_whole(arguments) else PARTIAL)
    path.write_text(text, encoding='utf-8')
    print(f'The report is {path}')
    if path.parent == quote.RESULTS.parent and not arguments.quick:
        renew_quotations(arguments, text)
    return 0


def renew_quotations(arguments: argparse.Namespace, text: str) -> None:
    """Quote a report in the documents."""
    if is_whole(arguments):
        quote.renew(quote.README, quote.MEASURED, quote.summary(text))
        print(f'Quoted in {quote.README}')
    if 'sensitivity' in arguments.only:
        quote.renew(quote.DESIGN, quote.SENSITIVITY, quote.body(text, sensitivity.TITLE))
        print(f'Quoted in {quote.DESIGN}')


if __name__ == '__main__':
    sys.exit(main())
