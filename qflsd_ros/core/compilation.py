"""
Kernels, compiled by numba without the GIL, and kept on disk, from where numba is not needed.

Kernels allocate no memory: arrays are passed in.  Numba's reference counting of arrays (``_nrt``)
is therefore off; it takes a fifth of the time where kernels call each other.

A compiled kernel contains the kernels that it calls, which may come from other files.  The cache
folder is therefore named by a digest of the core and of all other sources that hold kernels.  It
lies below ``NUMBA_CACHE_DIR`` if that is set, or else below the user's cache folder.
"""
from __future__ import annotations

from collections.abc import Callable
import errno
import hashlib
from importlib.metadata import version
import os
from pathlib import Path
import sys
from typing import Any, NamedTuple, TypeVar

from qflsd_ros.core.kernels.kernel import Kernel
from qflsd_ros.core.kernels.store import NAME_SIZE, Store

Function = TypeVar('Function', bound=Callable[..., Any])
NUMBA = version('numba')    # without importing it


class Progress(NamedTuple):
    """How far the compilation is: of all kernels of a package, those compiled by this process."""

    compiled: int
    kernels: int


def _cache_home() -> Path:
    """Return the folder for caches; OSError where there is none."""
    chosen = os.environ.get('NUMBA_CACHE_DIR') or os.environ.get('XDG_CACHE_HOME')
    home = Path(chosen or os.path.expanduser('~/.cache'))
    if home.parts[0] == '~':
        raise FileNotFoundError(errno.ENOENT, 'this user has no home folder', str(home))
    return home.absolute()


def _folder() -> Path:
    """Return where compiled code is kept; OSError where there is no place for it."""
    digest = hashlib.sha256(f'{NUMBA} {sys.implementation.cache_tag}'.encode())
    for source in sorted(Path(__file__).parents[1].rglob('*.py')):
        content = source.read_bytes()
        if source.is_relative_to(Path(__file__).parent) or b'core.compilation import' in content:
            digest.update(content)
    return _cache_home() / 'qflsd_ros' / digest.hexdigest()[:NAME_SIZE]


STORE = Store(_folder)
_kernels: list[Kernel] = []


def progress(package: str) -> Progress:
    """Return how many kernels of a package this process has had to compile."""
    kernels = [kernel for kernel in _kernels if kernel.module.startswith(f'{package}.')]
    return Progress(sum(kernel.compiled > 0 for kernel in kernels), len(kernels))


def _kernel(**options: Any) -> Callable[[Function], Any]:
    """Return a decorator that makes a kernel of a function."""
    def decorate(function: Function) -> Kernel:
        kernel = Kernel(function, options, STORE)
        _kernels.append(kernel)
        return kernel
    return decorate


compiled = _kernel()
inlined = _kernel(forceinline=True)
# Sums may be formed in any order, several terms at once.
summed = _kernel(fastmath={'reassoc', 'contract', 'nsz'})
