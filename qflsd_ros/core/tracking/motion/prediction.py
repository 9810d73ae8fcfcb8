"""Prediction: the places of tracks in the next frame, by the motion field and their own motion."""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.compilation import compiled
from qflsd_ros.core.detection.frame import Frame
from qflsd_ros.core.tracking.curve import at, curve
from qflsd_ros.core.tracking.motion import field, looks
from qflsd_ros.core.tracking.motion.field import CUBIC
from qflsd_ros.core.tracking.motion.vote import translation
from qflsd_ros.core.tracking.state import COLUMNS, END, LOST, MIDDLE, SHIFT, START, TURN

# All of these are chosen, not tuned.
LONGEST = 100           # tracks, the longest ones, from which the motion is estimated
BALLOTS, NORMALS = 3, 6     # normals of each for the votes, and for the fit of the field
# Largest translation, px along x and y: from the last motion, and from rest or an unknown motion.
USUAL, WIDE = 18, 40
REACH = 6.0             # px, length of a normal on either side, after the voted translation
LOST_BELOW = 0.5        # share of normals that agree with the motion, below which it is unknown
SURE = 0.75             # the same, from which on no other motion is tried


@compiled
def _carry(before: np.ndarray, rows: np.ndarray, motion: np.ndarray, shape: tuple[int, int],
           phi: np.ndarray) -> None:
    """Move tracks by the field, and along their normals by their own motion relative to it."""
    for i in range(len(rows)):
        for column in (START, MIDDLE, END):
            x, y = before[i, column], before[i, column + 1]
            u, v = field.motion(motion, x, y, shape[1], shape[0], phi)
            rows[i, column], rows[i, column + 1] = x + u, y + v
        arc = curve(rows, i)
        for column, share in ((START, -1.0), (MIDDLE, 0.0), (END, 1.0)):
            x, y, nx, ny = at(arc, share)
            own = rows[i, SHIFT] + rows[i, TURN] * share
            rows[i, column], rows[i, column + 1] = x + own * nx, y + own * ny


class Motion:
    """The motion field from frame to frame, which predicts the tracks."""

    def __init__(self) -> None:
        """Begin at rest."""
        self.field = np.zeros(CUBIC)
        self.lost = 1           # frames since it was known
        self._before = np.zeros((0, COLUMNS))
        self._looks = looks.memory(LONGEST * NORMALS)
        self._votes = {reach: np.empty((2 * reach + 1, 2 * reach + 1), np.int32)
                       for reach in (USUAL, WIDE)}
        self._memory = field.memory()

    def predict(self, image: Frame, rows: np.ndarray) -> bool:
        """
        Move tracks (M, COLUMNS) to where they are expected in a frame.

        Returns
        -------
        True if more than LOST_BELOW of the normals agree with one motion field.  It is False for
        an empty frame and for another scene; then the tracks move by the last field.

        """
        self._before = rows.copy()
        shape = image.dx.shape
        chosen = self._longest(rows)
        still = np.zeros(CUBIC)
        best, sure = self.field, 0.0
        # Acceleration is small; but a frame may be repeated, or the camera have stopped.
        for prior, reach in ((self.field, WIDE if self.lost else USUAL), (still, WIDE)):
            if sure < SURE:
                found, agreeing = self._try(image, rows, chosen, prior, reach)
                if agreeing > max(sure, LOST_BELOW):
                    best, sure = found, agreeing
        self.field = best
        self.lost = 0 if sure > 0 else self.lost + 1
        _carry(self._before, rows, self.field, shape, self._memory.phi)
        return sure > 0

    def _longest(self, rows: np.ndarray) -> np.ndarray:
        """Return the numbers of the longest tracks of the last frame with a known motion."""
        candidates = np.flatnonzero(rows[:, LOST] <= self.lost)
        chords = np.hypot(rows[candidates, END] - rows[candidates, START],
                          rows[candidates, END + 1] - rows[candidates, START + 1])
        return candidates[np.argsort(-chords, kind='stable')[:LONGEST]]

    def _try(self, image: Frame, rows: np.ndarray, chosen: np.ndarray, prior: np.ndarray,
             reach: int) -> tuple[np.ndarray, float]:
        """Return the field estimated from a prior, and the share of normals that agree."""
        shape, memory = image.dx.shape, self._memory
        _carry(self._before, rows, prior, shape, memory.phi)
        n = looks.look(image, self._before, rows, chosen, (BALLOTS, float(reach)), self._looks)
        if n == 0:
            return prior, 0.0
        memory.prior[:] = prior
        memory.prior[:2] += translation(self._looks, n, self._votes[reach])
        _carry(self._before, rows, memory.prior, shape, memory.phi)
        n = looks.look(image, self._before, rows, chosen, (NORMALS, REACH), self._looks)
        agreeing = field.estimate(self._looks, n, shape, memory)
        return memory.field.copy(), agreeing
