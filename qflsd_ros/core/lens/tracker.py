"""
The lens of a camera over time, from the arcs of one frame after the other.

Frames that determine the lens alone are averaged, each with the weight of its variance, and
forgotten after a while.  Those that do not are taken together as far as they are other views:
the same edges in the same place err alike, however often they are seen.
"""
from __future__ import annotations

from dataclasses import replace

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.lens.estimation import (
    COLUMNS, estimate_from, LensEstimate, NORMAL, observe, POINT, telling)

MEMORY = 100            # frames that determine the lens, after which one of them counts 1 / e
START = 30              # frames that are all looked at
EVERY = 16              # later the first of so many, as long as they show the same lens
ROOM = 300              # arcs kept of frames that do not determine the lens alone
# Distance between the middles of arcs, of half the diagonal, and sine of the angle between them,
# up to which they are one edge in two frames.  The lambda of a true circle changes by about as
# large a share as its place does, too little to count as another observation.
NEAR, PARALLEL = 0.1, 0.17
KNOWN = 0.5             # share of a frame's arcs that are not new, from which on it is no new view
# Mahalanobis distance from which on a frame is an outlier, for lambda alone and with the centre:
# normal errors exceed either once in 16000.
DEVIATIONS = {1: 4.0, 3: 4.7}
TINY = 1e-12             # in place of 0 where something is divided by it
PATIENCE = 15           # outliers in a row after which the lens is another one


class LensTracker:
    """
    Estimates the lens from frame to frame.

    Attributes
    ----------
    estimate
        The lens by all frames so far, or None while they do not tell it.  ``agreeing`` and
        ``share`` are those of the newest frame that counted.
    outliers
        Number of frames that told another lens and were left out.

    """

    def __init__(self, centre: bool = False) -> None:
        """Begin; ``centre`` tells whether the centre of distortion is estimated as well."""
        self._centre = centre
        self.estimate: LensEstimate | None = None
        self.outliers = 0
        self._forget((0, 0))

    def add(self, arcs: Arcs, shape: tuple[int, int]) -> None:
        """
        Take in the arcs of the next frame, of a shape (height, width) in px.

        Most frames are passed over later on: they are much like their neighbours, and looking at
        each would cost some percent of the time that its detection takes.
        """
        if shape != self._shape:
            self._forget(shape)
        self._frames += 1
        if self._frames > START and self._frames % EVERY and not self._contrary:
            return
        seen = telling(observe(arcs, shape))
        frame = estimate_from(seen, shape, self._centre)
        alone = frame is not None
        if frame is None and self._is_new_view(seen):
            self._waiting = np.concatenate([seen, self._waiting])[:ROOM]
            frame = estimate_from(self._waiting, shape, self._centre)
        if frame is None:
            return
        self._waiting = self._waiting[:0]
        if self._is_outlier(frame):
            self.outliers += 1
            # Evidence from several frames does not replace that of a single one.
            self._contrary += alone or not self._alone
            if self._contrary < PATIENCE:
                return
            self._forget(shape)
        self._contrary = 0
        self._alone |= alone
        self._average(frame)

    def _forget(self, shape: tuple[int, int]) -> None:
        self._shape, self._frames, self._contrary, self.estimate = shape, 0, 0, None
        self._alone = False     # whether a single frame has determined the lens
        self._waiting = np.empty((0, COLUMNS))
        self._weight = self._squares = self._mean = self._last = np.zeros(3)
        self._variance = self._scatter = self._steps = np.zeros(3)

    def _is_new_view(self, seen: np.ndarray) -> bool:
        """Compare arcs with those that wait; drop of these what is seen anew in another view."""
        old = self._waiting
        apart = np.linalg.norm(seen[:, None, POINT:] - old[:, POINT:], axis=2)
        normals, others = seen[:, NORMAL:POINT], old[:, NORMAL:POINT]
        turn = np.abs(normals[:, [0]] * others[:, 1] - normals[:, [1]] * others[:, 0])
        same = (apart < NEAR) & (turn < PARALLEL)
        if np.count_nonzero(same.any(axis=1)) >= KNOWN * len(seen):
            return False
        self._waiting = old[~same.any(axis=0)]
        return True

    def _is_outlier(self, frame: LensEstimate) -> bool:
        if self.estimate is None:
            return False
        free = 3 if self._centre else 1
        off = (_values(frame) - _values(self.estimate))[:free]
        covariance = (frame.covariance + self.estimate.covariance)[:free, :free]
        return off @ np.linalg.solve(covariance, off) > DEVIATIONS[free] ** 2

    def _average(self, frame: LensEstimate) -> None:
        """Take in a frame: running means of lambda and centre, of their variance and scatter."""
        values, deviations = _values(frame), np.sqrt(np.diag(frame.covariance))
        weights = 1 / np.maximum(deviations, TINY) ** 2
        first, keep = not self._weight.any(), 1 - 1 / MEMORY
        self._weight = keep * self._weight + weights
        self._squares = keep ** 2 * self._squares + weights ** 2
        share, off = weights / self._weight, values - self._mean
        self._mean = self._mean + share * off
        self._variance = self._variance + share * (deviations ** 2 - self._variance)
        if not first:
            self._scatter = (1 - share) * (self._scatter + share * off ** 2)
            self._steps = self._steps + share * ((values - self._last) ** 2 - self._steps)
        self._last = values
        model = replace(frame.model, lam=float(self._mean[0]),
                        centre=tuple(self._mean[1:].tolist()) if self._centre else None)
        # Correlated as in the newest frame.
        scale = self._deviations() / np.maximum(deviations, TINY)
        self.estimate = replace(frame, model=model,
                                covariance=frame.covariance * np.outer(scale, scale))

    def _deviations(self) -> np.ndarray:
        """
        Return the standard deviations of lambda and of the centre's x and y.

        Errors that frames have in common, since they show the same scene, are not in their
        scatter: they stay however many frames there are.  The scatter falls off with their
        number, as far as one does not follow the one before.
        """
        alike = np.maximum(self._variance - self._scatter, 0)
        follow = 1 - self._steps / np.maximum(2 * self._scatter, TINY)
        follow = np.clip(follow, 0, 0.99)
        number = self._weight ** 2 / self._squares * (1 - follow) / (1 + follow)
        return np.sqrt(alike + self._scatter / np.maximum(number, 1))


def _values(estimate: LensEstimate) -> np.ndarray:
    """Return lambda and the centre's x and y, px."""
    return np.array([estimate.lam, *estimate.model.origin])
