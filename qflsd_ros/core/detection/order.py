"""The order of arcs by length, by a sort of integers."""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.compilation import compiled

GRAIN = 1024            # units of a px to which lengths are rounded; chosen, not tuned


@compiled
def _keys(lengths: np.ndarray, wanted: np.ndarray, keys: np.ndarray) -> int:
    """Write a sort key for each wanted length, smaller for a longer one; return their number."""
    count = 0
    for i in range(len(lengths)):
        if wanted[i]:
            keys[count] = int(-GRAIN * lengths[i]) * len(lengths) + i
            count += 1
    return count


def longest_first(lengths: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """
    Return the indices of the wanted lengths, the longest first.

    ``lengths`` is (M,) float64, px, ``wanted`` (M,) bool; the result is (K,) int64.  Of equal
    lengths the smaller index comes first.
    """
    keys = np.empty(len(lengths), np.int64)
    # numba compiles anew for a strided column; a column of one element is contiguous as it is.
    keys = keys[:_keys(np.ascontiguousarray(lengths), wanted, keys)]
    # Sorting integers is faster than an argsort of the lengths.
    keys.sort()
    return np.remainder(keys, len(lengths), out=keys)
