"""
Step 1b: the edge map as ordered chains of pixels.

Moore-neighbour tracing (the paper's choice) runs out and back along an open edge, so that every
line is there twice.  This walk visits each pixel once: out from the first pixel of an edge in one
direction, then from the same pixel in the other, straight on where edges meet.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.edges import STRONG

# The 8 neighbours in order of their direction, from the x axis to the y axis and on.
STEP_X = np.array([1, 1, 0, -1, -1, -1, 0, 1], np.int64)
STEP_Y = np.array([0, 1, 1, 1, 0, -1, -1, -1], np.int64)
UNIT_X = STEP_X / np.hypot(STEP_X, STEP_Y)
UNIT_Y = STEP_Y / np.hypot(STEP_X, STEP_Y)
ANY_STRONG = np.uint64(STRONG * 0x0101010101010101)     # eight edge pixels at once
BYTE_NUMBERS = np.uint64(0x0001020304050607)
# Of a direction (x, y) by the bits x > 0, y > 0, closest to the x axis and to the y axis.
OCTANTS = np.array([5, 7, 3, 1, 4, 0, 4, 0, 6, 6, 2, 2], np.int64)
MEMORY = 0.75       # share of the direction so far in the direction after the next step
TAN_22 = math.sqrt(2) - 1       # tangent of 22.5 degrees


def steps(width: int) -> np.ndarray:
    """Return what leads to a pixel's 8 neighbours, (8,) int64, in rows of ``width`` pixels."""
    return STEP_Y * width + STEP_X


@inlined
def _next(edges: np.ndarray, at: int, steps: np.ndarray, before: int, ux: float,
          uy: float) -> int:
    """
    Return the neighbour (0 to 7) with which a chain goes on, or -1.

    It is the only one within 45 degrees of the last step; of several, the one closest to (ux, uy);
    else the closest within 90 degrees.
    """
    ahead = edges[at + steps[before]] != 0
    left = edges[at + steps[(before - 1) & 7]] != 0
    right = edges[at + steps[(before + 1) & 7]] != 0
    near = ahead + left + right
    if near == 1:
        return (before + right - left) & 7
    if near == 0:
        left = edges[at + steps[(before - 2) & 7]] != 0
        right = edges[at + steps[(before + 2) & 7]] != 0
        if left != right:
            return (before + 2 * right - 2 * left) & 7
        if not left:
            return -1
        # The sine of the angle from the last step to (ux, uy) tells which is closer to that.
        return (before + (2 if UNIT_X[before] * uy > UNIT_Y[before] * ux else -2)) & 7
    best, cosine = -1, -10.0
    for turn in range(-1, 2):
        k = (before + turn) & 7
        along = ux * UNIT_X[k] + uy * UNIT_Y[k]
        if edges[at + steps[k]] != 0 and along > cosine:
            best, cosine = k, along
    return best


@inlined
def _first(strong: np.uint64) -> int:
    """Return the number (0 to 7) of the first strong pixel of eight; one there must be."""
    # Of 2^(8 k + 1) the multiplication brings byte 7 - k, which is k, to the top.
    lowest = strong & (~strong + np.uint64(1))
    return int(((lowest >> np.uint64(1)) * BYTE_NUMBERS) >> np.uint64(56))


@inlined
def _octant(x: float, y: float) -> int:
    """Return the number (0 to 7) of the neighbour closest to the direction (x, y)."""
    flat, steep = abs(y) < TAN_22 * abs(x), abs(x) < TAN_22 * abs(y)
    return OCTANTS[(x > 0) + 2 * (y > 0) + 4 * flat + 8 * steep]


@inlined
def _walk(edges: np.ndarray, steps: np.ndarray, at: int, k: int, ux: float, uy: float,
          pixels: np.ndarray, n: int) -> int:
    """
    Follow an edge from a pixel on, appending to ``pixels`` from row n on; return the new n.

    Its direction is (ux, uy), and k that of the neighbour closest to that.
    """
    while True:
        k = _next(edges, at, steps, k, ux, uy)
        if k < 0:
            return n
        at += steps[k]
        edges[at] = 0
        pixels[n] = at
        n += 1
        ux = MEMORY * ux + (1 - MEMORY) * UNIT_X[k]
        uy = MEMORY * uy + (1 - MEMORY) * UNIT_Y[k]


@inlined
def _turn_round(values: np.ndarray, first: int, last: int) -> None:
    while first < last:
        values[first], values[last] = values[last], values[first]
        first += 1
        last -= 1


@inlined
def _chain(edges: np.ndarray, steps: np.ndarray, at: int, ux: float, uy: float,
           pixels: np.ndarray, n: int) -> int:
    """Append the whole chain through a pixel from row n on; return the new n."""
    k = _octant(ux, uy)
    edges[at] = 0
    end = _walk(edges, steps, at, k, ux, uy, pixels, n)
    # Turn round what has been walked, and go on from where it began in the other direction.
    _turn_round(pixels, n, end - 1)
    pixels[end] = at
    return _walk(edges, steps, at, (k + 4) & 7, -ux, -uy, pixels, end + 1)


@compiled
def trace(dx: np.ndarray, dy: np.ndarray, edges: np.ndarray, words: np.ndarray,
          steps: np.ndarray, shortest: int, pixels: np.ndarray, offsets: np.ndarray) -> int:
    """
    Cut an edge map into chains, each begun at a strong pixel; their pixels are taken out of it.

    Parameters
    ----------
    dx, dy
        (H W,) int16 gradients: a chain starts out at right angles to them.
    edges, words
        The edge map as :func:`edges.find` leaves it.
    steps
        (8,) int64, from a pixel to its neighbours, of :func:`steps`.
    shortest
        Chains of fewer pixels are dropped.
    pixels
        (E,) int32 with room for all edge pixels: those of the chains, y W + x, one chain behind
        the other.
    offsets
        (E / shortest + 2,) int64: where each chain begins, and after the last one where it ends.

    Returns
    -------
    Number of chains.

    """
    chains, n = 0, 0
    offsets[0] = 0
    for word in range(len(words)):
        strong = words[word] & ANY_STRONG
        while strong != 0:
            at = 8 * word + _first(strong)
            gx, gy = float(dx[at]), float(dy[at])
            # Down the image first, whichever side of the edge is brighter.
            size = math.copysign(math.sqrt(gx * gx + gy * gy), gx if gx != 0 else -gy)
            end = _chain(edges, steps, at, -gy / size, gx / size, pixels, n)
            if end - n >= shortest:
                n = end
                chains += 1
                offsets[chains] = n
            strong = words[word] & ANY_STRONG
    return chains
