"""Directions of arcs over time: each track keeps its direction while that is likely."""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.attitude.estimation import most_likely

# Probability, averaged over time, from which on another direction replaces that of a track; and
# frames after which one counts 1 / e at most.  Chosen, not tuned: an arc between two directions
# has .5 of each.
CLEAR, MEMORY = 0.75, 10


class TrackLabels:
    """The directions of the tracks of the last frame."""

    def __init__(self) -> None:
        self._tracks = np.zeros(0, np.uint32)
        self._labels = np.zeros(0, np.int64)
        self._means = np.zeros((0, 3))              # of the probabilities, (M, K)
        self._frames = np.zeros(0)                  # in these means

    def follow(self, arcs: Arcs, probabilities: np.ndarray, same: int) -> np.ndarray:
        """
        Return the direction of each arc of the next frame: (M,) int64, -1 for none.

        Parameters
        ----------
        arcs
            The arcs.  Without tracks, each has the direction that is most likely in this frame.
        probabilities
            (M, K), that an arc points in each of the directions.
        same
            Number of directions that are those of the last frame; they come before new ones.

        """
        labels, means, frames = most_likely(probabilities), probabilities, np.ones(len(arcs))
        if not arcs.is_tracked:
            return labels
        tracks = arcs.table['track']
        _, now, then = np.intersect1d(tracks, self._tracks, return_indices=True)
        frames[now] += np.minimum(self._frames[then], MEMORY - 1)
        before = probabilities[now]
        before[:, :same] = self._means[then, :same]
        means = probabilities.copy()
        means[now] = before + (probabilities[now] - before) / frames[now, None]
        labels[now] = _kept(self._labels[then], means[now], same)
        self._tracks, self._labels, self._means, self._frames = tracks, labels, means, frames
        return labels


def _kept(labels: np.ndarray, means: np.ndarray, same: int) -> np.ndarray:
    """Return the labels, or those that are clearly more likely by now."""
    best = most_likely(means)
    chance = np.column_stack([means, 1 - means.sum(axis=1)])    # the last column is -1, none
    clear = chance[np.arange(len(best)), best] > CLEAR
    return np.where(clear | (labels >= same), best, labels)
