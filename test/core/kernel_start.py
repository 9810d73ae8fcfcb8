"""A process that uses a kernel: forked from one that has imported all that it needs."""
from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import resource
import sys

import numba
from qflsd_ros.core.compilation import compiled

NOBODY = 54321  # a user who has no name and no home


@compiled
def twice(x):
    return 2 * x


def nothing() -> None:
    """Begin at once."""


def drop_root() -> None:
    """Become another user: root may write anywhere."""
    numba.njit(lambda x: x + 1)(1)  # what numba imports late, another user may not read
    if os.geteuid() == 0:
        os.setresuid(NOBODY, NOBODY, NOBODY)


def fill_the_disk() -> None:
    """Let no file grow beyond 1000 bytes: writing fails in the midst of it, as on a full disk."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))


def mask_nothing() -> None:
    os.umask(0)


def have_no_home() -> None:
    drop_root()
    for name in ('HOME', 'XDG_CACHE_HOME'):
        os.environ.pop(name, None)


def run(cache: Path | None, first: Callable[[], object], output: Path) -> None:
    """
    Write what the kernel gives for integers and for floats, and how many of both were kept.

    Files ``stdout`` and ``stderr`` of the folder ``output`` take what is printed.
    """
    for stream in (sys.stdout, sys.stderr):
        descriptor = os.open(output / stream.name.strip('<>'), os.O_WRONLY | os.O_CREAT)
        os.dup2(descriptor, stream.fileno())
    os.environ['NUMBA_CACHE_DIR'] = str(cache or '')
    os.chdir(output)
    first()
    print(twice(21), twice(1.25), twice.versions - twice.compiled)
    sys.stdout.flush()
