"""The lines of successive frames as a SLAM system takes them: few, balanced, with numbers."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.line_features.numbering import Numbering
from qflsd_ros.core.line_features.pace import Pace
from qflsd_ros.core.line_features.selection import balanced, Candidates, groups
from qflsd_ros.core.line_features.undistorted import Lines


class Limits(NamedTuple):
    """
    Limits of the choice.

    Attributes
    ----------
    most
        Largest number of lines.
    min_length
        Shortest line, px in the image.
    cameras, camera
        Number of cameras, and which of them this is, from 0.

    """

    most: int
    min_length: float
    cameras: int = 1
    camera: int = 0


class Feed:
    """
    The choice of lines over the frames of one camera.

    Attributes
    ----------
    pace
        Says which frames are due.

    """

    def __init__(self) -> None:
        """Begin without a frame."""
        self.pace = Pace()
        self._numbering = Numbering()

    def take(self, lines: Lines, arcs: Arcs, shape: tuple[int, int], limits: Limits
             ) -> tuple[Lines, np.ndarray]:
        """
        Choose the lines of the next frame that is due.

        Parameters
        ----------
        lines
            All lines of the frame.
        arcs, shape
            The arcs that they are of, with tracks, and the frame's (height, width).
        limits
            Limits of the choice.

        Returns
        -------
        lines, ids
            The chosen lines, in the order of their arcs, and their ids, (N,) int64.

        """
        long = lines.lengths >= limits.min_length
        table = arcs.table[lines.arcs[long]]
        tracks = table['track'].astype(np.int64)
        candidates = Candidates(
            groups(table['start'], table['end'], shape), np.isin(tracks, self._numbering.tracks),
            table['age'].astype(np.int64), lines.lengths[long], tracks)
        kept = balanced(candidates, limits.most)
        chosen = Lines(*(column[long][kept] for column in lines))
        return chosen, self._numbering.take(tracks[kept], limits.cameras, limits.camera)
