"""
The state of the tracks: a row of numbers for each.

A track is an arc through three points, in order of travel, with the brighter side to the right.
It may extend beyond the image, so that lines that leave it are found again.
"""
from __future__ import annotations

import numpy as np

# Columns of a row.  Start, middle and end are x and y, px.
START, MIDDLE, END = 0, 2, 4
CONTRAST = 6        # grey levels, mean step across
POLARITY = 7        # as that of an arc: share of points with the brighter side right, less left
SCORE = 8           # running mean of the scores of arcs on it; 0 in a frame without one
IDENTITY = 9
AGE = 10            # frames in which it was reported
LOST = 11           # frames since it was confirmed
# Own motion along the normal relative to the field, px in a frame: of its middle, and of its end
# relative to the middle.
SHIFT, TURN = 12, 13
SUPPORT = 14        # share of its normals in sight that have a supporting edge
FIRST, LAST = 15, 16    # its supported part: from -1 at its start to 1 at its end
RMS = 17            # px, rms distance of the supporting edges
EDGES = 18          # number of supporting edges
HELD = 19           # 1 where no arc was detected on it in this frame
STEP = 20           # grey levels, mean step across in this frame
REPORTED = 21       # 1 where it is confirmed and its score suffices
COLUMNS = 22

MOST = 4096         # tracks, lost ones included: more than an image has arcs; chosen, not tuned


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
        """Remove the tracks where ``wanted``, (count,) bool, is False."""
        if wanted.all():
            return
        kept = self.rows[wanted]
        self._rows[:len(kept)] = kept
        self.count = len(kept)

    def add(self, rows: np.ndarray) -> None:
        """Append rows (N, COLUMNS); those beyond MOST tracks in all are dropped."""
        rows = rows[:MOST - self.count]
        self._rows[self.count:self.count + len(rows)] = rows
        self.count += len(rows)
