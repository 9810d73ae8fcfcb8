"""
Confirmation: which tracks are reported, kept or forgotten, by their support and their score.

Hysteresis over time: a track of the last frame stays with less support and a lower score than a
new or lost one needs.
"""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.compilation import compiled
from qflsd_ros.core.tracking import curve, state
from qflsd_ros.core.tracking.association import Outcome

# Least share of supported normals of a track of the last frame.  Tuned on photographs seen by a
# turning camera: of 0.3 to 0.5, 0.3 keeps most identities, and right@10 falls by 0.002 at most.
SUPPORTED = 0.3
# All of the following are chosen, not tuned.
FOUND_AGAIN = 0.6           # least share of supported normals of a lost track
NEVER = 2.0                 # the same, above any share, so that no track is confirmed
# Least score of a reported track, relative to min_score: of a new one, and of one reported in the
# last frame.
SURER, LESS = 2.0, -3.0
PATIENCE = 60               # frames for which a lost track is kept that was established
OVER = 2 * PATIENCE         # frames lost, of a track that has ended
ESTABLISHED = 3             # frames in which a track must have been reported to be established
YOUNG = 5                   # frames for which other lost tracks are kept
FORGOTTEN = 1.0             # score below which a track ends
RECENT = 0.9                # weight of the past in the running mean of the score
COVERED = 0.5               # least share of a track's chord with arcs on it, to be detected


def needed(rows: np.ndarray, known: bool) -> np.ndarray:
    """
    Return the least share of supported normals of each track, (M,) float64.

    No track (M, COLUMNS) is confirmed while the motion of the image is not ``known``.
    """
    if not known:
        return np.full(len(rows), NEVER)
    return np.where(rows[:, state.LOST] > 0, FOUND_AGAIN, SUPPORTED)


@compiled
def rate(rows: np.ndarray, confirmed: np.ndarray, outcome: Outcome) -> None:
    """
    Update score and HELD of all tracks.

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
        chord = 2 * curve.curve(rows, i)[4]
        rows[i, state.HELD] = outcome.covered[i] < COVERED * chord
        if confirmed[i]:
            rows[i, state.SCORE] += (1 - RECENT) * (outcome.scores[i] - rows[i, state.SCORE])


@compiled
def count(rows: np.ndarray, confirmed: np.ndarray, min_score: float, wanted: np.ndarray) -> None:
    """
    Decide which tracks are reported and kept, and count the frames in which they are lost.

    Parameters
    ----------
    rows
        (M, COLUMNS) float64, the tracks.
    confirmed
        (M,) bool, which are confirmed.
    min_score
        The parameter of the detector.
    wanted
        (M,) bool, receives which are kept.

    """
    for i in range(len(rows)):
        least = min_score + (LESS if rows[i, state.REPORTED] else SURER)
        reported = confirmed[i] and rows[i, state.SCORE] >= least
        rows[i, state.REPORTED] = reported
        rows[i, state.LOST] = 0 if confirmed[i] else rows[i, state.LOST] + 1
        patience = PATIENCE if rows[i, state.AGE] + reported >= ESTABLISHED else YOUNG
        wanted[i] = rows[i, state.LOST] <= patience and rows[i, state.SCORE] >= FORGOTTEN
