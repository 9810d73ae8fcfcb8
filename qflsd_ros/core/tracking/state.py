"""
What a tracker knows of its tracks: one row of numbers for each.

A track is an arc through three points, in order of travel, with the brighter side to the right.
It may reach beyond the image: lines that leave it come back.
"""
from __future__ import annotations

import numpy as np

# Columns of a row: start, middle and end, px, x and y one after the other; ...
START, MIDDLE, END = 0, 2, 4
CONTRAST = 6        # grey levels, mean step across
POLARITY = 7        # as that of an arc: share of points with the brighter side right, less left
SCORE = 8           # mean over frames, of late, of the arcs on it; 0 in a frame without one
IDENTITY = 9
AGE = 10            # frames in which it was reported
LOST = 11           # frames since it was confirmed
DETECTED = 12       # how often it is detected anew, of late: 0 to 1
SHIFT, TURN = 13, 14    # px by which its middle, and its end more than that, outrun the field
SUPPORT = 15        # share of its normals in sight with an edge on it
FIRST, LAST = 16, 17    # where it is supported, -1 at its start to 1 at its end
RMS = 18            # px, of the edges on its normals from it
EDGES = 19          # number of these
CONFIRMED = 20      # 1 where its support suffices in this frame
HELD = 21           # 1 where no arc was detected on it in this frame
STEP = 22           # grey levels, mean step across in this frame
REPORTED = 23       # 1 where it is confirmed and its score suffices
COLUMNS = 24

MOST = 4096         # tracks, lost ones included: more than any image has arcs that are worth it


class Tracks:
    """Rows of all tracks, in the order of their birth."""

    def __init__(self) -> None:
        """Begin without a track."""
        self.count = 0
        self._rows = np.zeros((MOST, COLUMNS))

    @property
    def rows(self) -> np.ndarray:
        """Return the rows: (count, COLUMNS) float64, a view."""
        return self._rows[:self.count]

    def keep(self, wanted: np.ndarray) -> None:
        """Keep those tracks alone that a (count,) bool array says."""
        if wanted.all():
            return
        kept = self.rows[wanted]
        self._rows[:len(kept)] = kept
        self.count = len(kept)

    def add(self, rows: np.ndarray) -> None:
        """Append rows (N, COLUMNS), as many as there is room for."""
        rows = rows[:MOST - self.count]
        self._rows[self.count:self.count + len(rows)] = rows
        self.count += len(rows)
