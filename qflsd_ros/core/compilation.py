"""
How the kernels are compiled: by numba, without the GIL, and kept on disk.

numba counts references to arrays where one function calls another, which costs more than many a
kernel: what is called in an inner loop is therefore inlined.
"""
from __future__ import annotations

import logging

from numba import njit


def _can_cache() -> bool:
    """Return whether numba finds a folder that it may write its cache to; say so if not."""
    try:
        njit(cache=True)(_can_cache)
    except RuntimeError:
        logging.getLogger(__name__).warning(
            'numba cannot keep compiled code: neither the folder of this package nor the home '
            'folder can be written; every start compiles anew (about 20 s). Set NUMBA_CACHE_DIR '
            'to a folder that can be written.')
        return False
    return True


_options = {'cache': _can_cache(), 'nogil': True, 'error_model': 'numpy'}
compiled = njit(**_options)
inlined = njit(inline='always', **_options)
# Sums may be formed in any order, several terms at once.
summed = njit(fastmath={'reassoc', 'contract', 'nsz'}, **_options)
