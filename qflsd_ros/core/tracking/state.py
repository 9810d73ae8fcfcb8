"""
The state of the tracks: a row of numbers for each.

A track is an arc through three points, in order of travel, with the brighter side to the right.
It may extend beyond the image, so that lines that leave it are found again.
"""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.compilation import compiled

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
WANTED = 22         # 1 while it is kept
COLUMNS = 23

MOST = 4096         # tracks, lost ones included: more than an image has arcs; chosen, not tuned


@compiled
def _keep(rows: np.ndarray) -> int:
    """Move the wanted rows to the front, in order; return their number."""
    count = 0
    for i in range(len(rows)):
        if rows[i, WANTED] == 0:
            continue
        if count < i:
            for column in range(COLUMNS):
                rows[count, column] = rows[i, column]
        count += 1
    return count


class Tracks:
    """Rows of all tracks, in the order of their birth."""

    def __init__(self) -> None:
        """Begin without a track."""
        self.count = 0
        self.memory = np.zeros((MOST, COLUMNS))

    @property
    def rows(self) -> np.ndarray:
        """Return the rows: (count, COLUMNS) float64, a view."""
        return self.memory[:self.count]

    def keep_wanted(self) -> None:
        """Remove the tracks that are not wanted."""
        self.count = _keep(self.rows)
