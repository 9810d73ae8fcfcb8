"""The report: Markdown tables and pictures, the machine, and the versions of everything."""
from __future__ import annotations

from collections.abc import Iterable, Sequence
import datetime
import importlib.metadata
import math
import os
from pathlib import Path
import platform
import re
import subprocess

import cv2

ROOT = Path(__file__).parents[1]
PACKAGES = ('numpy', 'numba', 'scipy', 'pytlsd', 'lsdetect')


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a Markdown table; the first column is text, the others are numbers."""
    lines = [header, ['---', *['---:'] * (len(header) - 1)], *rows]
    return '\n'.join('| ' + ' | '.join(map(str, line)) + ' |' for line in lines)


def number(value: float, digits: int = 3) -> str:
    """Return a number with a fixed count of digits after the point, - for nan."""
    return '-' if math.isnan(value) else f'{value:.{digits}f}'


def significant(value: float) -> str:
    """Return a number above 0 with three significant digits."""
    if math.isnan(value):
        return '-'
    return f'{value:.{max(0, 2 - math.floor(math.log10(max(value, 1e-9))))}f}'


def picture(path: Path, output: Path, text: str) -> str:
    """Return a Markdown picture, relative to the report's folder."""
    return f'![{text}]({path.relative_to(output).as_posix()})'


def section(title: str, *parts: str) -> str:
    """Return a section; its parts are paragraphs, tables and pictures."""
    return '\n\n'.join([f'## {title}', *parts]) + '\n'


def conditions(command: str) -> str:
    """Return the section on the machine, the revision and the versions of all libraries."""
    now = datetime.datetime.now(datetime.timezone.utc)
    versions = {'Python': platform.python_version(), 'OpenCV': cv2.__version__}
    for name in PACKAGES:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = 'not installed'
    return section(
        'Conditions', f'Written by `{command}`, not edited by hand.',
        table(('condition', 'value'), [
            ('date', f'{now:%Y-%m-%d %H:%M} UTC'), ('revision', _revision()),
            ('processor', _processor()), ('cores', len(os.sched_getaffinity(0))),
            ('system', f'{platform.system()} {platform.release()} {platform.machine()}'),
            *versions.items()]))


def _processor() -> str:
    found = re.search(r'model name\s*: (.*)', Path('/proc/cpuinfo').read_text())
    return found[1] if found else platform.machine()


def _revision() -> str:
    """Return the commit, and whether files of the package differ from it."""
    def git(*arguments: str) -> str:
        return subprocess.run(['git', '-C', str(ROOT), *arguments], capture_output=True,
                              text=True).stdout.strip()

    commit = git('rev-parse', '--short=12', 'HEAD')
    if not commit:
        return 'not in a git repository'
    changed = git('status', '--porcelain', '--', 'qflsd_ros', 'config', 'benchmark/*.py')
    return f'{commit}, with changes' if changed else commit
