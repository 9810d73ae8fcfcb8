"""
The choice of a limited number of lines that is balanced, and that changes little.

Lines are grouped by orientation and quarter of the image, and all groups take turns: a wall of
bricks does not displace the only vertical line.  Within its group a line that was chosen before
comes first, then long tracks, then long lines.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Age, frames, from which on a new line takes the place of one that was chosen before, where groups
# are out of balance.  Younger ones fill free places only: many tracks end after few frames.
# Chosen, not tuned: 15 instead changes the number of lines with 5 observations by 2 % at most.
SETTLED = 5
# Groups: steep and flat lines in each quarter of the image.
ORIENTATIONS, QUARTERS = 2, 4


class Candidates(NamedTuple):
    """
    N lines, of which some are chosen.

    Attributes
    ----------
    groups
        (N,) int64, see :func:`groups`.
    chosen
        (N,) bool, whether the line was chosen in the previous frame.
    ages
        (N,) frames that the track has been seen in.
    lengths
        (N,) length of the line, any unit.
    tracks
        (N,) identities, which decide between lines that are equal otherwise.

    """

    groups: np.ndarray
    chosen: np.ndarray
    ages: np.ndarray
    lengths: np.ndarray
    tracks: np.ndarray


def groups(starts: np.ndarray, ends: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """
    Return a number from 0 to 7 for each line: its quarter of the image, and its orientation.

    Parameters
    ----------
    starts, ends
        (N, 2) px.
    shape
        (height, width) of the image.

    """
    x, y = ((starts + ends) / 2).T
    along = np.abs(ends - starts)
    height, width = shape
    quarter = 2 * (y > (height - 1) / 2) + (x > (width - 1) / 2)
    return ORIENTATIONS * quarter + (along[:, 1] > along[:, 0])


def balanced(candidates: Candidates, most: int) -> np.ndarray:
    """
    Choose lines, at most ``most``.

    Returns
    -------
    chosen
        (K,) int64, ascending numbers of candidates; all of them if they are not more than
        ``most``.

    """
    groups, chosen, ages, lengths, tracks = candidates
    young = ~chosen & (ages < SETTLED)
    within = tracks, -lengths, -ages, ~chosen, young    # lexsort: the last key counts most
    by_group = np.lexsort((*within, groups))
    ordered = groups[by_group]
    turn = np.empty(len(groups), np.int64)
    turn[by_group] = np.arange(len(groups)) - np.searchsorted(ordered, ordered)
    return np.sort(np.lexsort((*within[:-1], turn, young))[:most])
