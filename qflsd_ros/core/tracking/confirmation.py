"""
Confirmation: which tracks are reported, kept or forgotten, by their support and their score.

Hysteresis over time: a track of the last frame stays with less support and a lower score than a
new or lost one needs.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.tracking import curve, state
from qflsd_ros.core.tracking.association import associate, Detected, enter_all, Outcome
from qflsd_ros.core.tracking.neighbours import clear, Grid

# Least share of supported normals of a track of the last frame.  Tuned on photographs seen by a
# turning camera: of 0.3 to 0.5, 0.3 keeps most identities, and right@10 falls by 0.002 at most.
SUPPORTED = 0.3
# All of the following are chosen, not tuned.
FOUND_AGAIN = 0.6           # least share of supported normals of a lost track
# Least score of a reported track, relative to min_score: of a new one, and of one reported in the
# last frame.
SURER, LESS = 2.0, -3.0
NEVER = -1                  # the patience with which no track is measured
PATIENCE = 60               # frames for which a lost track is kept that was established
OVER = 2 * PATIENCE         # frames lost, of a track that has ended
ESTABLISHED = 3             # frames in which a track must have been reported to be established
YOUNG = 5                   # frames for which other lost tracks are kept
FORGOTTEN = 1.0             # score below which a track ends
RECENT = 0.9                # weight of the past in the running mean of the score
PREFERRED = 2.0             # weight of the length of an established track, to a new one
COVERED = 0.5               # least share of a track's chord with arcs on it, to be detected


class Limits(NamedTuple):
    """Parameters of the detector."""

    min_distance: float     # px
    min_score: float


@inlined
def needed(rows: np.ndarray, i: int) -> float:
    """Return the least share of supported normals of track i."""
    return FOUND_AGAIN if rows[i, state.LOST] > 0 else SUPPORTED


@inlined
def rank(rows: np.ndarray, ranks: np.ndarray) -> None:
    """
    Write what the order of tracks is by, the largest first: the chord, px, times a bonus.

    A track that is established and was reported in the last frame comes before others that are
    not PREFERRED times as long.  ``ranks`` is (M,).
    """
    for i in range(len(rows)):
        chord = math.hypot(rows[i, state.END] - rows[i, state.START],
                           rows[i, state.END + 1] - rows[i, state.START + 1])
        old = rows[i, state.AGE] >= ESTABLISHED and rows[i, state.REPORTED] > 0
        ranks[i] = PREFERRED * chord if old else chord


@inlined
def rate(rows: np.ndarray, confirmed: np.ndarray, outcome: Outcome) -> None:
    """
    Update score and HELD of all tracks by the arcs of a frame; hidden tracks are not confirmed.

    Parameters
    ----------
    rows
        (M, COLUMNS) float64, the tracks.
    confirmed
        (M,) bool, which are confirmed; others keep their scores.
    outcome
        The result of the association with the arcs of the frame.

    """
    for i in range(len(rows)):
        if outcome.absorbed[i]:
            rows[i, state.LOST] = OVER
        confirmed[i] = confirmed[i] and not (outcome.hidden[i] or outcome.absorbed[i])
        chord = 2 * curve.curve(rows, i)[4]
        rows[i, state.HELD] = outcome.covered[i] < COVERED * chord
        if confirmed[i]:
            rows[i, state.SCORE] += (1 - RECENT) * (outcome.scores[i] - rows[i, state.SCORE])


@compiled
def count(rows: np.ndarray, confirmed: np.ndarray, min_score: float) -> None:
    """
    Decide which tracks are reported and kept, and count the frames in which they are lost.

    Parameters
    ----------
    rows
        (M, COLUMNS) float64, the tracks; WANTED receives which are kept.
    confirmed
        (M,) bool, which are confirmed.
    min_score
        The parameter of the detector.

    """
    for i in range(len(rows)):
        least = min_score + (LESS if rows[i, state.REPORTED] else SURER)
        reported = confirmed[i] and rows[i, state.SCORE] >= least
        rows[i, state.LOST] = 0 if confirmed[i] else rows[i, state.LOST] + 1
        patience = PATIENCE if rows[i, state.AGE] + reported >= ESTABLISHED else YOUNG
        wanted = rows[i, state.LOST] <= patience and rows[i, state.SCORE] >= FORGOTTEN
        rows[i, state.REPORTED], rows[i, state.WANTED] = reported and wanted, wanted


@compiled
def decide(grid: Grid, rows: np.ndarray, confirmed: np.ndarray, detected: Detected,
           limits: Limits, outcome: Outcome) -> None:
    """
    Associate the arcs of a frame with the confirmed tracks, and decide which are reported.

    Parameters
    ----------
    grid, outcome
        Memory.
    rows
        (M, COLUMNS) float64, the tracks.
    confirmed
        (M or more,) bool, which are confirmed; those that lie on others no longer are.
    detected
        The arcs; receives their fates.
    limits
        Of the detector.

    """
    rank(rows, outcome.ranks)
    clear(grid)
    enter_all(grid, rows, confirmed, limits.min_distance, outcome)
    associate(grid, rows, detected, limits.min_distance, outcome)
    rate(rows, confirmed, outcome)
    count(rows, confirmed, limits.min_score)
