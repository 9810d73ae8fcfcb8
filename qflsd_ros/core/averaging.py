"""
Averages of quantities that successive frames measure, with deviations that stay honest.

Frames of the same scene have errors in common, which more frames do not average out.  The part of
their stated variance that exceeds their scatter is therefore taken for that of common errors.
"""
from __future__ import annotations

import numpy as np

TINY = 1e-12            # lower bound of divisors, far below any variance that occurs


class Average:
    """
    The mean of measurements, weighted by their inverse variance, with an exponential memory.

    Parameters
    ----------
    size
        Number of quantities, n.
    memory
        Measurements after which one counts 1 / e.

    Attributes
    ----------
    mean
        (n,) float64; 0 before the first measurement.

    """

    def __init__(self, size: int, memory: float) -> None:
        self._memory = memory
        self.mean = np.zeros(size)
        # Sum of the weights and of their squares; mean variance of the measurements; scatter of
        # the measurements about the mean; mean squared difference of successive ones; the last.
        self._weight = self._squares = np.zeros(size)
        self._variance = self._scatter = self._steps = self._last = np.zeros(size)

    def __bool__(self) -> bool:
        """Return whether there has been a measurement."""
        return bool(self._weight.any())

    def add(self, values: np.ndarray, deviations: np.ndarray) -> None:
        """Take a measurement, (n,), with its standard deviations, (n,)."""
        weights = 1 / np.maximum(deviations, TINY) ** 2
        first, keep = not self, 1 - 1 / self._memory
        self._weight = keep * self._weight + weights
        self._squares = keep ** 2 * self._squares + weights ** 2
        share, off = weights / self._weight, values - self.mean
        self.mean = self.mean + share * off
        self._variance = self._variance + share * (deviations ** 2 - self._variance)
        if not first:
            self._scatter = (1 - share) * (self._scatter + share * off ** 2)
            self._steps = self._steps + share * ((values - self._last) ** 2 - self._steps)
        self._last = values

    def deviations(self) -> np.ndarray:
        """
        Return the standard deviations of the mean, (n,).

        The part of the frames' variance that their scatter does not show is that of their common
        errors, and does not fall with the number of frames.  The scatter
        falls with the effective number of frames, which accounts for the weights and for the
        correlation of successive frames (first-order autoregression).
        """
        common = np.maximum(self._variance - self._scatter, 0)
        correlation = 1 - self._steps / np.maximum(2 * self._scatter, TINY)
        correlation = np.clip(correlation, 0, 0.99)     # below 1, which would leave no frame
        number = self._weight ** 2 / self._squares * (1 - correlation) / (1 + correlation)
        return np.sqrt(common + self._scatter / np.maximum(number, 1))
