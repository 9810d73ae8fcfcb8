"""
Step 1b: the edge map as ordered chains of pixels.

Moore-neighbour tracing (the paper's choice) runs out and back along an open edge, so that every
line is there twice.  This walk visits each pixel once: out from the first pixel of an edge in one
direction, then from the same pixel in the other, straight on where edges meet.
"""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.circle import compiled, inlined

# The 8 neighbours in order of their direction, in steps of 45 degrees from the x axis to the y axis.
STEP_X = np.array([1, 1, 0, -1, -1, -1, 0, 1], np.int64)
STEP_Y = np.array([0, 1, 1, 1, 0, -1, -1, -1], np.int64)
UNIT_X = STEP_X / np.hypot(STEP_X, STEP_Y)
UNIT_Y = STEP_Y / np.hypot(STEP_X, STEP_Y)
MEMORY = 0.75       # share of the direction so far in the direction after the next step
SHARPEST = 0.0      # cosine of the sharpest turn that a chain may make


@inlined
def _next(edges: np.ndarray, at: int, width: int, ux: float, uy: float) -> int:
    """Return the neighbour (0 to 7) that continues the direction (ux, uy) best, or -1."""
    best, cosine = -1, SHARPEST * np.sqrt(ux * ux + uy * uy)
    for k in range(8):
        if edges[at + STEP_Y[k] * width + STEP_X[k]] != 0:
            along = ux * UNIT_X[k] + uy * UNIT_Y[k]
            if best < 0 and along >= cosine or along > cosine:
                best, cosine = k, along
    return best


@compiled
def _walk(edges: np.ndarray, width: int, x: int, y: int, ux: float, uy: float,
          xs: np.ndarray, ys: np.ndarray, n: int) -> int:
    """Follow an edge from (x, y) on, appending to xs, ys from row n; return the new n."""
    at = y * width + x
    while True:
        k = _next(edges, at, width, ux, uy)
        if k < 0:
            return n
        x += STEP_X[k]
        y += STEP_Y[k]
        at = y * width + x
        edges[at] = 0
        xs[n], ys[n] = x, y
        n += 1
        ux = MEMORY * ux + (1 - MEMORY) * UNIT_X[k]
        uy = MEMORY * uy + (1 - MEMORY) * UNIT_Y[k]


@compiled
def _chain(edges: np.ndarray, width: int, x: int, y: int,
           xs: np.ndarray, ys: np.ndarray, n: int) -> int:
    """Append the whole chain through the pixel (x, y) from row n on; return the new n."""
    first = n
    edges[y * width + x] = 0
    xs[n], ys[n] = x, y
    n = _walk(edges, width, x, y, 0.0, 0.0, xs, ys, n + 1)
    ahead = min(first + 6, n - 1)
    # Turn the first half round and go on from where it began, away from it.
    i, j = first, n - 1
    while i < j:
        xs[i], xs[j] = xs[j], xs[i]
        ys[i], ys[j] = ys[j], ys[i]
        i += 1
        j -= 1
    behind = n - 1 - (ahead - first)
    return _walk(edges, width, x, y, float(x - xs[behind]), float(y - ys[behind]), xs, ys, n)


@compiled
def trace(edges: np.ndarray, words: np.ndarray, width: int, shortest: int,
          xs: np.ndarray, ys: np.ndarray, offsets: np.ndarray) -> int:
    """
    Cut an edge map into chains; the map is zero afterwards.

    Parameters
    ----------
    edges
        (S,) uint8, the rows of the edge map one behind the other, not zero at edge pixels, with
        its outermost rows and columns zero; S is a multiple of 8.
    words
        The same memory as (S / 8,) uint64: most of it is empty, and is skipped by the word.
    width
        Pixels in a row.
    shortest
        Chains of fewer pixels are dropped.
    xs, ys
        (E,) int32 with room for all edge pixels: the chains' pixels, one chain behind the other.
    offsets
        (E / shortest + 2,) int64: where each chain begins, and after the last one where it ends.

    Returns
    -------
    Number of chains.

    """
    chains, n = 0, 0
    offsets[0] = 0
    for word in range(len(words)):
        if words[word] == 0:
            continue
        for at in range(8 * word, 8 * word + 8):
            if edges[at] == 0:
                continue
            end = _chain(edges, width, at % width, at // width, xs, ys, n)
            if end - n >= shortest:
                n = end
                chains += 1
                offsets[chains] = n
    return chains
