"""Pieces in order of their length."""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.compilation import compiled

GRAIN = 1024            # parts of a px in which lengths are compared


@compiled
def _keys(lengths: np.ndarray, wanted: np.ndarray, keys: np.ndarray) -> int:
    """Write a number for each that is wanted, smaller for a longer one; return how many."""
    count = 0
    for i in range(len(lengths)):
        if wanted[i]:
            keys[count] = int(-GRAIN * lengths[i]) * len(lengths) + i
            count += 1
    return count


def longest_first(lengths: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the numbers, (K,) int64, of those of (M,) lengths that are wanted, longest first."""
    keys = np.empty(len(lengths), np.int64)
    # Of a column: a single one is contiguous, several are not, and each would be compiled for.
    keys = keys[:_keys(np.ascontiguousarray(lengths), wanted, keys)]
    # Which sorts faster than an argsort of the lengths.
    keys.sort()
    return np.remainder(keys, len(lengths), out=keys)
