"""Birth: tracks that begin with the arcs of a frame that lie on no track."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from qflsd_ros.core import arcs as columns
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.tracking import state
from qflsd_ros.core.tracking.association import Detected, NEW
from qflsd_ros.core.tracking.state import MOST

LAST_IDENTITY = 2 ** 24     # consumers carry identities as float32, which is exact up to there
# Columns of an arc, and those of a track that take their values.
TAKEN = ((columns.CONTRAST, state.CONTRAST), (columns.POLARITY, state.POLARITY),
         (columns.SCORE, state.SCORE), (columns.RMS, state.RMS))


class Chains(NamedTuple):
    """The edge points of arcs, as those of :class:`arcs.Arcs`."""

    points: np.ndarray      # (2, N) float64, x and y, px
    offsets: np.ndarray     # (M + 1,) int64: where those of each arc begin


class Limits(NamedTuple):
    """What new tracks need."""

    number: int             # the next identity, if no track has it
    least_score: float      # of a new track that is reported at once


@inlined
def _is_alive(rows: np.ndarray, count: int, number: int) -> bool:
    """Return whether one of the first ``count`` tracks has an identity."""
    for i in range(count):
        if rows[i, state.IDENTITY] == number:
            return True
    return False


@inlined
def _take(arcs: np.ndarray, k: int, row: np.ndarray) -> None:
    """Write the values of arc k to the row of a new track."""
    row[:] = 0.0
    for column in range(state.START, state.END + 2):
        row[column] = arcs[k, column]
    for column, own in TAKEN:
        row[own] = arcs[k, column]
    row[state.FIRST], row[state.LAST], row[state.WANTED] = -1.0, 1.0, 1.0


@inlined
def _take_points(chains: Chains, k: int, points: np.ndarray) -> int:
    """Take points of arc k, evenly from the first to the last, where there is room for."""
    first, count = chains.offsets[k], chains.offsets[k + 1] - chains.offsets[k]
    taken = min(count, len(points))
    for j in range(taken):
        at = first + j * (count - 1) // max(taken - 1, 1)
        points[j, 0], points[j, 1] = chains.points[0, at], chains.points[1, at]
    return int(taken)


@compiled
def begin(detected: Detected, chains: Chains, limits: Limits, rows: np.ndarray, count: int,
          points: np.ndarray) -> tuple[int, int]:
    """
    Begin a track with each arc whose fate is NEW; those beyond MOST tracks in all are dropped.

    Parameters
    ----------
    detected, chains
        The arcs of the frame.
    limits
        What new tracks need.
    rows, count
        (MOST, COLUMNS) float64, memory of the tracks, of which ``count`` are alive; receives the
        new ones behind these.
    points
        (MOST, N, 2) float64, receives edge points of each new track, px.

    Returns
    -------
    The number of tracks, and the next identity: after LAST_IDENTITY again 1, but for those alive.

    """
    number = limits.number
    for k in range(len(detected.arcs)):
        if detected.fates[k] != NEW or count == MOST:
            continue
        while _is_alive(rows, count, number):
            number = number % LAST_IDENTITY + 1
        row = rows[count]
        _take(detected.arcs, k, row)
        row[state.IDENTITY] = number
        row[state.REPORTED] = row[state.SCORE] >= limits.least_score
        row[state.EDGES] = _take_points(chains, k, points[count])
        number = number % LAST_IDENTITY + 1
        count += 1
    return count, number
