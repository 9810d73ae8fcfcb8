"""
The headline table of the README: mean accuracy and time of all detectors, read off the report.

It stands between two marks.  Run as ``python3 -m benchmark.quote``; ``script/benchmark`` does it
after a run of everything.
"""
from __future__ import annotations

from collections import defaultdict
import re

from benchmark.report import number, ROOT, table
import numpy as np

README, RESULTS = ROOT / 'README.md', ROOT / 'benchmark' / 'RESULTS.md'
BEGIN, END = '<!-- measured -->\n', '<!-- end of measured -->\n'
FIGURES = {'F': 'F', 'F1': 'F at 1 px', 'whole': 'whole', 'curved whole': 'long lines whole',
           'fragments': 'fragments', 'rms': 'rms, px'}
OVER_OURS = 'over ours'
Row = dict[str, str]


def body(report: str, title: str) -> str:
    """Return what stands in the section whose title begins so."""
    found = re.search(rf'^## {title}.*?\n(.*?)(?=^## |\Z)', report, re.DOTALL | re.MULTILINE)
    if found is None:
        raise ValueError(f'the report has no section {title!r}')
    return found[1].strip()


def rows(report: str, title: str) -> list[Row]:
    """Return the rows of all tables of the section whose title begins so, by their columns."""
    result = []
    for block in re.findall(r'(?:^\|.*\n?)+', body(report, title), re.MULTILINE):
        header, _, *lines = ([cell.strip() for cell in line.strip('|').split('|')]
                             for line in block.splitlines())
        result += [dict(zip(header, line)) for line in lines]
    return result


def summary(report: str) -> str:
    """Return a sentence and a table: mean accuracy and time of all detectors."""
    accuracy: dict[str, list[Row]] = defaultdict(list)
    for row in rows(report, 'Accuracy'):
        if 'level' in row:
            accuracy[row['detector']].append(row)
    times = {row['detector']: row[OVER_OURS] for row in rows(report, 'Table 2')
             if OVER_OURS in row}
    lines = []
    for detector, of_levels in accuracy.items():
        means = [float(np.nanmean([_value(row[name]) for row in of_levels])) for name in FIGURES]
        lines.append((detector, *map(number, means), times[detector]))
    images = re.search(r'^## (Accuracy on \d+ annotated images)', report, re.MULTILINE)
    if images is None:
        raise ValueError('the report has no section on the accuracy on annotated images')
    levels = len(next(iter(accuracy.values())))
    return (f'{images[1]}, means over {levels} levels of distortion, and CPU time on one thread; '
            f'definitions and all other results: [{RESULTS.name}](benchmark/{RESULTS.name}).'
            '\n\n' + table(('detector', *FIGURES.values(), 'CPU time over ours'), lines))


def _value(cell: str) -> float:
    return float('nan') if cell == '-' else float(cell)


def renewed(readme: str, report: str) -> str:
    """Return the README with the summary of a report between its marks."""
    pattern = re.compile(f'(?<={BEGIN}).*?(?={END})', re.DOTALL)
    text, count = pattern.subn(lambda _: summary(report) + '\n', readme)
    if count != 1:
        raise ValueError(f'README.md lacks the marks\n{BEGIN}{END}')
    return text


if __name__ == '__main__':
    README.write_text(renewed(README.read_text(), RESULTS.read_text()))
