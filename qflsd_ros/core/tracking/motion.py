"""Where tracks are expected in the next frame: by the motion of the image, and their own."""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.compilation import compiled
from qflsd_ros.core.detection.frame import Frame
from qflsd_ros.core.tracking import field
from qflsd_ros.core.tracking.curve import at, curve
from qflsd_ros.core.tracking.field import CUBIC, TERMS
from qflsd_ros.core.tracking.looks import LOOK, look
from qflsd_ros.core.tracking.normals import EDGES
from qflsd_ros.core.tracking.state import COLUMNS, END, LOST, MIDDLE, SHIFT, START, TURN
from qflsd_ros.core.tracking.vote import translation

LONGEST = 100           # tracks that the motion is estimated from
BALLOTS, NORMALS = 3, 6     # normals of each that vote, and that the field is fitted to
# px of a search either way: where the motion before goes on, and where it is unknown.
USUAL, WIDE = 18, 40
REACH = 6.0             # px, of a search about the voted translation
LOST_BELOW = 0.5        # share of normals that agree with the motion, below which it is unknown
SURE = 0.75             # above which it is not looked for farther away


@compiled
def _carry(before: np.ndarray, rows: np.ndarray, motion: np.ndarray, shape: tuple[int, int],
           phi: np.ndarray) -> None:
    """Move tracks by the field, and by what they outrun it."""
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
    """The motion of the image from frame to frame."""

    def __init__(self) -> None:
        """Begin at rest."""
        self.field = np.zeros(CUBIC)
        self.lost = 1           # frames since it was known
        self._before = np.zeros((0, COLUMNS))
        self._looks = np.empty((LONGEST * NORMALS, LOOK))
        self._found = np.empty((LONGEST * NORMALS + 1, EDGES))
        self._counts = np.empty(LONGEST * NORMALS, np.int64)
        self._votes = {reach: np.empty((2 * reach + 1, 2 * reach + 1), np.int32)
                       for reach in (USUAL, WIDE)}
        self._a, self._b = np.empty((CUBIC, CUBIC)), np.empty(CUBIC)
        self._phi = np.empty(TERMS)

    def predict(self, image: Frame, rows: np.ndarray) -> bool:
        """
        Move tracks (M, COLUMNS) to where they are expected in a frame.

        Returns
        -------
        Whether the image moves as the tracks do: without that it shows nothing, or another scene.

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
        _carry(self._before, rows, self.field, shape, self._phi)
        return sure > 0

    def _longest(self, rows: np.ndarray) -> np.ndarray:
        """Return the longest tracks of those that were seen last."""
        candidates = np.flatnonzero(rows[:, LOST] <= self.lost)
        chords = np.hypot(rows[candidates, END] - rows[candidates, START],
                          rows[candidates, END + 1] - rows[candidates, START + 1])
        return candidates[np.argsort(-chords, kind='stable')[:LONGEST]]

    def _try(self, image: Frame, rows: np.ndarray, chosen: np.ndarray, prior: np.ndarray,
             reach: int) -> tuple[np.ndarray, float]:
        """Return the motion found from an expected one, and how sure it is."""
        shape = image.dx.shape
        result = np.empty(CUBIC)
        _carry(self._before, rows, prior, shape, self._phi)
        n = look(image, self._before, rows, chosen, BALLOTS, (0.0, 0.0), float(reach),
                 self._looks, self._found, self._counts)
        if n == 0:
            return prior, 0.0
        x, y, _ = translation(self._looks, self._found, self._counts, n, self._votes[reach])
        prior = prior.copy()
        prior[:2] += x, y
        _carry(self._before, rows, prior, shape, self._phi)
        n = look(image, self._before, rows, chosen, NORMALS, (0.0, 0.0), REACH,
                 self._looks, self._found, self._counts)
        sure = field.estimate(self._looks, self._found, self._counts, n, shape, prior,
                              result, self._a, self._b, self._phi)
        return result, sure
