"""
How the kernels are compiled: by numba, without the GIL, and kept on disk.

Kernels allocate nothing: what memory they need is handed to them.  So numba need not count
references to arrays (``_nrt``), which costs it a fifth of all time where one calls another.

numba looks at one file to see whether what it kept of it is still right, but kernels hold code of
other files.  What is kept therefore lies in a folder named by a digest of the core and of all
other sources that hold kernels, below ``NUMBA_CACHE_DIR`` if that is set, or else below the user's
cache folder.
"""
from __future__ import annotations

from collections.abc import Callable
import hashlib
import logging
import os
from pathlib import Path
from typing import Any

import numba


def _cache_folder() -> Path | None:
    """Return the folder for compiled code, or None, and say so, where none can be written."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parents[1].rglob('*.py')):
        content = source.read_bytes()
        if source.is_relative_to(Path(__file__).parent) or b'core.compilation import' in content:
            digest.update(content)
    home = os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache')
    folder = (Path(os.environ.get('NUMBA_CACHE_DIR') or home) / 'qflsd_ros'
              / digest.hexdigest()[:16])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
        reason = 'it cannot be written'
    except OSError as error:
        reason = error.strerror
    logging.getLogger(__name__).warning(
        'compiled code cannot be kept in %s (%s): every start compiles anew, for about half a '
        'minute. Set NUMBA_CACHE_DIR to a folder that can be written.', folder, reason)
    return None


_FOLDER = _cache_folder()


def _kernel(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator like ``numba.njit`` that keeps what it compiles in our folder."""
    def decorate(function: Callable[..., Any]) -> Any:
        before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(_FOLDER or '')
        try:
            return numba.njit(cache=_FOLDER is not None, nogil=True, error_model='numpy',
                              _nrt=False, **options)(function)
        finally:
            numba.config.CACHE_DIR = before
    return decorate


compiled = _kernel()
inlined = _kernel(forceinline=True)
# Sums may be formed in any order, several terms at once.
summed = _kernel(fastmath={'reassoc', 'contract', 'nsz'})
