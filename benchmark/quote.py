"""
Tables of the report that documents quote, between marks such as ``<!-- measured -->``.

The README quotes the means of all detectors; doc/design.md quotes the sensitivity to constants.
``script/benchmark`` renews the quotations after a run that measured them.
``python3 -m benchmark.quote`` renews that of the README from the report.
"""
from __future__ import annotations

from collections import defaultdict
from pathlib import Path
import re

from benchmark.report import number, ROOT, table
import numpy as np

README, DESIGN = ROOT / 'README.md', ROOT / 'doc' / 'design.md'
RESULTS = ROOT / 'benchmark' / 'RESULTS.md'
MEASURED, SENSITIVITY = 'measured', 'sensitivity'       # marks
FIGURES = {'F': 'F', 'F1': 'F at 1 px', 'whole': 'whole', 'curved whole': 'long lines whole',
           'fragments': 'fragments', 'rms': 'rms, px'}
OVER_OURS = 'over ours'
Row = dict[str, str]


def body(report: str, title: str) -> str:
    """Return the text of the section whose title begins with ``title``."""
    found = re.search(rf'^## {title}.*?\n(.*?)(?=^## |\Z)', report, re.DOTALL | re.MULTILINE)
    if found is None:
        raise ValueError(f'the report has no section {title!r}')
    return found[1].strip()


def rows(report: str, title: str) -> list[Row]:
    """Return the rows of all tables of a section, as texts by the names of their columns."""
    result: list[Row] = []
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
    assert images is not None, 'rows() has found this section'
    levels = len(next(iter(accuracy.values())))
    return (f'{images[1]}, means over {levels} levels of distortion, and CPU time on one thread; '
            f'definitions and all other results: [{RESULTS.name}](benchmark/{RESULTS.name}).'
            '\n\n' + table(('detector', *FIGURES.values(), 'CPU time over ours'), lines))


def _value(cell: str) -> float:
    return float('nan') if cell == '-' else float(cell)


def renewed(text: str, mark: str, quotation: str) -> str:
    """Return a document with a quotation in place of the old one, between the marks of a name."""
    begin, end = f'<!-- {mark} -->\n', f'<!-- end of {mark} -->\n'
    pattern = re.compile(f'(?<={begin}).*?(?={end})', re.DOTALL)
    text, count = pattern.subn(lambda _: f'{quotation}\n', text)
    if count != 1:
        raise ValueError(f'a document must have these marks once:\n{begin}{end}')
    return text


def renew(path: Path, mark: str, quotation: str) -> None:
    """Renew a quotation in a file."""
    text = renewed(path.read_text(encoding='utf-8'), mark, quotation)
    path.write_text(text, encoding='utf-8')


if __name__ == '__main__':
    renew(README, MEASURED, summary(RESULTS.read_text(encoding='utf-8')))
