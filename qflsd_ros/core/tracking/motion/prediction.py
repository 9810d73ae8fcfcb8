"""
Prediction: the places of tracks in the next frame, by the motion field and their own motion.

The field is estimated from the longest tracks: first a translation by votes, from a few normals of
each, then the field from more and shorter ones.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.tracking.curve import at, curve
from qflsd_ros.core.tracking.motion import field, looks
from qflsd_ros.core.tracking.motion.field import CUBIC, Extent, extent
from qflsd_ros.core.tracking.motion.vote import translation
from qflsd_ros.core.tracking.normals import Sight
from qflsd_ros.core.tracking.state import END, LOST, MIDDLE, MOST, SHIFT, START, TURN

# All of these are chosen, not tuned.
LONGEST = 100           # tracks, the longest ones, from which the motion is estimated
BALLOTS, NORMALS = 3, 6     # normals of each for the votes, and for the fit of the field
# Largest translation, px along x and y: from the last motion, and from rest or an unknown motion.
USUAL, WIDE = 18, 40
REACH = 6.0             # px, length of a normal on either side, after the voted translation
LOST_BELOW = 0.5        # share of normals that agree with the motion, below which it is unknown
SURE = 0.75             # the same, from which on no other motion is tried
PLACES = 6              # numbers of the three points of a track
LENGTHS = 1024          # px, from which on tracks are equally long: they are sorted by whole px


class Memory(NamedTuple):
    """Arrays that the prediction works on."""

    motion: np.ndarray      # (CUBIC,) float64, the field from the frame before to this one
    still: np.ndarray       # (CUBIC,) float64, the field of an image at rest
    best: np.ndarray        # (CUBIC,) float64, the best field so far
    before: np.ndarray      # (MOST, PLACES) float64, the places of tracks in the frame before
    chosen: np.ndarray      # (LONGEST,) int64, the tracks from which the motion is estimated
    lengths: np.ndarray     # (LENGTHS,) int64, number of tracks by length
    usual: np.ndarray       # (2 USUAL + 1, 2 USUAL + 1) int32, votes
    wide: np.ndarray        # (2 WIDE + 1, 2 WIDE + 1) int32, votes
    looks: looks.Looks
    field: field.Memory


def _memory() -> Memory:
    """Return memory at rest."""
    usual, wide = (np.empty((2 * reach + 1, 2 * reach + 1), np.int32) for reach in (USUAL, WIDE))
    return Memory(np.zeros(CUBIC), np.zeros(CUBIC), np.zeros(CUBIC), np.empty((MOST, PLACES)),
                  np.empty(LONGEST, np.int64), np.empty(LENGTHS, np.int64), usual, wide,
                  looks.memory(LONGEST * NORMALS), field.memory())


@inlined
def _copy(source: np.ndarray, target: np.ndarray) -> None:
    """Copy a field; numba's own copy would allocate memory, as both might overlap."""
    for k in range(CUBIC):
        target[k] = source[k]


@inlined
def _carry(before: np.ndarray, rows: np.ndarray, i: int, motion: np.ndarray,
           size: Extent) -> None:
    """Move a track by the field, and along its normals by its own motion relative to it."""
    for column in (START, MIDDLE, END):
        x, y = before[i, column], before[i, column + 1]
        u, v = field.motion(motion, x, y, size)
        rows[i, column], rows[i, column + 1] = x + u, y + v
    arc = curve(rows, i)
    for column, share in ((START, -1.0), (MIDDLE, 0.0), (END, 1.0)):
        x, y, nx, ny = at(arc, share)
        own = rows[i, SHIFT] + rows[i, TURN] * share
        rows[i, column], rows[i, column + 1] = x + own * nx, y + own * ny


@inlined
def _length(rows: np.ndarray, i: int) -> int:
    """Return the length of a track's chord, rounded down to px; LENGTHS - 1 at most."""
    chord = math.hypot(rows[i, END] - rows[i, START], rows[i, END + 1] - rows[i, START + 1])
    return int(min(chord, LENGTHS - 1.0))


@inlined
def _choose(rows: np.ndarray, lost: int, memory: Memory) -> int:
    """Choose the longest tracks of the last frame with a known motion; return their number."""
    lengths = memory.lengths
    lengths[:] = 0
    for i in range(len(rows)):
        if rows[i, LOST] <= lost:
            lengths[_length(rows, i)] += 1
    # All that are longer than ``least`` are chosen, and of those of this length the first ones.
    least, longer = LENGTHS - 1, 0
    while least > 0 and longer + lengths[least] < LONGEST:
        longer += lengths[least]
        least -= 1
    count, room = 0, LONGEST - longer
    for i in range(len(rows)):
        length = _length(rows, i)
        if rows[i, LOST] > lost or length < least or (length == least and room == 0):
            continue
        room -= length == least
        memory.chosen[count] = i
        count += 1
    return count


@inlined
def _try(image: Sight, rows: np.ndarray, chosen: np.ndarray, prior: np.ndarray,
         votes: np.ndarray, memory: Memory) -> float:
    """Estimate the field from a prior; return the share of normals that agree with it."""
    size, estimated = extent(image.height, image.width), memory.field
    for i in chosen:
        _carry(memory.before, rows, i, prior, size)
    n = looks.look(image, memory.before, rows, chosen, (BALLOTS, len(votes) // 2 + 0.0),
                   memory.looks)
    if n == 0:
        return 0.0
    _copy(prior, estimated.prior)
    x, y = translation(memory.looks, n, votes)
    estimated.prior[0] += x
    estimated.prior[1] += y
    for i in chosen:
        _carry(memory.before, rows, i, estimated.prior, size)
    n = looks.look(image, memory.before, rows, chosen, (NORMALS, REACH), memory.looks)
    return field.estimate(memory.looks, n, size, estimated)


@compiled
def _predict(image: Sight, rows: np.ndarray, lost: int, memory: Memory) -> float:
    """Move tracks; return the share of normals that agree, or 0 if the motion is unknown."""
    for i in range(len(rows)):
        for column in range(PLACES):
            memory.before[i, column] = rows[i, column]
    chosen = memory.chosen[:_choose(rows, lost, memory)]
    _copy(memory.motion, memory.best)
    sure = 0.0
    # Acceleration is small; but a frame may be repeated, or the camera have stopped.
    for attempt in range(2):
        if sure < SURE:
            prior = memory.motion if attempt == 0 else memory.still
            votes = memory.usual if attempt == 0 and lost == 0 else memory.wide
            agreeing = _try(image, rows, chosen, prior, votes, memory)
            if agreeing > max(sure, LOST_BELOW):
                _copy(memory.field.field, memory.best)
                sure = agreeing
    _copy(memory.best, memory.motion)
    size = extent(image.height, image.width)
    for i in range(len(rows)):
        _carry(memory.before, rows, i, memory.motion, size)
    return sure


class Motion:
    """The motion field from frame to frame, which predicts the tracks."""

    def __init__(self) -> None:
        """Begin at rest."""
        self.lost = 1           # frames since it was known
        self._memory = _memory()

    def predict(self, image: Sight, rows: np.ndarray) -> bool:
        """
        Move tracks (M, COLUMNS) to where they are expected in a frame.

        Returns
        -------
        True if more than LOST_BELOW of the normals agree with one motion field.  It is False for
        an empty frame and for another scene; then the tracks move by the last field.

        """
        sure = _predict(image, rows, self.lost, self._memory)
        self.lost = 0 if sure > 0 else self.lost + 1
        return sure > 0
