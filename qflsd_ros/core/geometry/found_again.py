"""
Lines of a map that are one: an edge that was lost and found again has another track.

Two lines are the same if they differ by no more than their covariances say.  Of the line A, with
the point P, the line B is off by two shifts at P and two tilts; B's covariance is moved to P,

    (x, y, u, v) -> (x + t u, y + t v, u, v),  t the way from B's point to P,

and turned into A's directions across.  Edges that lie side by side may differ by as little: a pair
counts only if neither of the two could be a third line as well.
"""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.geometry.lines import Lines

# Squared normalised difference up to which two lines may be one: the 99 % quantile of chi^2 with 4
# degrees of freedom.
SAME = 13.3
# Cosine of the angle up to which it is looked at; errors of direction are below 5 degrees.
ALONG = 0.99
# Share of the shorter line that both must cover.  Chosen, not tuned.
COMMON = 0.3


def found_again(lines: Lines, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """
    Return pairs of lines that are one, the earlier one first: (P, 2) int64.

    Parameters
    ----------
    lines
        N determined lines.
    first, last
        (N,) int64, first and last image of each.  One of a pair ends before the other begins.

    """
    one, other = np.nonzero(np.triu(_close(lines), 1))
    same = _differences(lines.chosen(one), lines.chosen(other)) < SAME
    one, other = one[same], other[same]
    partners = np.bincount(np.concatenate([one, other]), minlength=len(first))
    alone = (partners[one] == 1) & (partners[other] == 1)
    forth, back = last[one] < first[other], last[other] < first[one]
    return np.concatenate([np.stack([one, other], axis=1)[alone & forth],
                           np.stack([other, one], axis=1)[alone & back]])


def _close(lines: Lines) -> np.ndarray:
    """Return which lines have about the same direction and a part in common: (N, N)."""
    along = lines.directions @ lines.directions.T
    # Positions of all points along each line, and the reaches of the other lines there.
    place = lines.directions @ lines.points.T - (
        lines.directions * lines.points).sum(axis=1)[:, None]
    first = np.maximum(lines.reaches[:, :1], place + lines.reaches[:, 0])
    last = np.minimum(lines.reaches[:, 1:], place + lines.reaches[:, 1])
    length = lines.reaches[:, 1] - lines.reaches[:, 0]
    shared = last - first > COMMON * np.minimum(length[:, None], length)
    return (along > ALONG) & shared & shared.T


def _differences(one: Lines, other: Lines) -> np.ndarray:
    """Return squared differences of pairs of lines over their covariances: (P,)."""
    along = (other.directions * one.directions).sum(axis=1, keepdims=True)
    way = ((one.points - other.points) * other.directions).sum(axis=1, keepdims=True)
    shift = other.points + way * other.directions - one.points
    tilt = other.directions / along - one.directions
    off = np.concatenate([np.einsum('nki,ni->nk', one.across, v) for v in (shift, tilt)], axis=1)
    turn = np.einsum('nki,nji->nkj', one.across, other.across)
    move = np.zeros((len(off), 4, 4))
    move[:, :2, :2] = move[:, 2:, 2:] = turn
    move[:, :2, 2:] = way[..., None] * turn
    covariances = one.covariances + np.einsum('nij,njk,nlk->nil', move, other.covariances, move)
    solved = np.linalg.solve(covariances, off[..., None])[..., 0]
    return np.asarray((off * solved).sum(axis=1))
