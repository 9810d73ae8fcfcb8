"""
The lens of a camera over time, from the arcs of one frame after the other.

Frames whose arcs tell the lens are averaged, each with the weight of its variance, and forgotten
after a while; those of too few arcs are taken together until they do.
"""
from __future__ import annotations

from dataclasses import replace

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.estimation import COLUMNS, estimate_from, LensEstimate, observe

MEMORY = 100            # frames that tell the lens, after which one of them counts 1 / e
START = 30              # frames that are all looked at
EVERY = 16              # later the first of so many, as long as they tell the same lens
ROOM = 300              # arcs kept of frames that do not tell the lens alone
DEVIATIONS = 4.0        # from which on a frame is an outlier
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
        self._waiting = np.concatenate([self._waiting[-ROOM:], observe(arcs, shape)])
        frame = estimate_from(self._waiting, shape, self._centre)
        if frame is None:
            return
        self._waiting = self._waiting[:0]
        if self._is_outlier(frame):
            self.outliers += 1
            self._contrary += 1
            if self._contrary < PATIENCE:
                return
            self._forget(shape)
        self._contrary = 0
        self._average(frame)

    def _forget(self, shape: tuple[int, int]) -> None:
        self._shape, self._frames, self._contrary, self.estimate = shape, 0, 0, None
        self._waiting = np.empty((0, COLUMNS))
        self._weight = self._squares = self._mean = self._last = np.zeros(3)
        self._variance = self._scatter = self._steps = np.zeros(3)

    def _is_outlier(self, frame: LensEstimate) -> bool:
        return self.estimate is not None and abs(frame.lam - self.estimate.lam) \
            > DEVIATIONS * np.hypot(frame.std, self.estimate.std)

    def _average(self, frame: LensEstimate) -> None:
        """Take in a frame: running means of lambda and centre, of their variance and scatter."""
        values = np.array([frame.lam, *frame.model.origin])
        deviations = np.array([frame.std, frame.centre_std, frame.centre_std])
        weights = 1 / np.maximum(deviations, 1e-6) ** 2
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
        std, x, y = self._deviations()
        model = replace(frame.model, lam=float(self._mean[0]),
                        centre=tuple(self._mean[1:].tolist()) if self._centre else None)
        self.estimate = replace(frame, model=model, std=float(std), centre_std=float(max(x, y)))

    def _deviations(self) -> np.ndarray:
        """
        Return the standard deviations of lambda and centre.

        What frames err alike, since they show the same scene, they do not scatter by: it stays
        however many there are.  What they scatter by falls off with their number, as far as one
        does not follow the one before.
        """
        alike = np.maximum(self._variance - self._scatter, 0)
        follow = 1 - self._steps / np.maximum(2 * self._scatter, 1e-12)
        follow = np.clip(follow, 0, 0.99)
        number = self._weight ** 2 / self._squares * (1 - follow) / (1 + follow)
        return np.sqrt(alike + (self._variance - alike) / np.maximum(number, 1))
