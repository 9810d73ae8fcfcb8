"""
The lens of a camera over time, estimated from the arcs of successive frames.

Frames that determine the lens by themselves are averaged, weighted by their inverse variance, with
an exponential memory.  The arcs of other frames are collected until they determine the lens
together, but only from different views: the same edges in the same place have the same errors,
however often they are seen.
"""
from __future__ import annotations

from dataclasses import replace

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.averaging import Average, TINY
from qflsd_ros.core.lens.estimation import estimate_from, LensEstimate
from qflsd_ros.core.lens.observation import COLUMNS, informative, NORMAL, observe, POINT

# All of these are chosen, not tuned, unless stated otherwise.
# Evaluated frames after which a frame counts 1 / e: about a minute of video, since lenses seldom
# change.
MEMORY = 100
# All of the first START frames are evaluated, so that the lens is known within a second; then one
# of EVERY frames while the lens stays the same, so that the tracker costs little time.
START, EVERY = 30, 16
# Arcs that are kept of frames that do not determine the lens by themselves: more than the largest
# of such frames have.
ROOM = 300
# Two arcs are the same edge in two frames if their middles are closer than NEAR half diagonals and
# the sine of the angle between them is below PARALLEL (10 degrees).  Between those limits, the
# lambda that a circle simulates changes by about the same share as its place: too little to count
# as another observation.
NEAR, PARALLEL = 0.1, 0.17
# A frame is a new view if less than this share of its arcs has been seen: most arcs are new.
KNOWN = 0.5
# Mahalanobis distance from which on a frame is an outlier, for lambda alone (1 unknown) and with
# the centre (3 unknowns): normally distributed errors exceed either once in 16000 frames.
DEVIATIONS = {1: 4.0, 3: 4.7}
# Successive outliers after which the lens is taken to have changed: half a second at 30 Hz, since
# every frame is evaluated after an outlier.
PATIENCE = 15


class LensTracker:
    """
    Estimates the lens from frame to frame.

    Parameters
    ----------
    centre
        Whether to estimate the distortion centre too; otherwise it is the image centre.

    Attributes
    ----------
    estimate
        The lens by all frames so far, or None while it is not observable.  ``agreeing`` and
        ``share`` are those of the last frame that was averaged.
    outliers
        Number of frames that were ignored because they contradict the estimate.

    """

    def __init__(self, centre: bool = False) -> None:
        self._centre = centre
        self.outliers = 0
        self._forget((0, 0))

    def _forget(self, shape: tuple[int, int]) -> None:
        """Discard all that is known of the lens; the frames that follow have the given shape."""
        self._shape = shape
        self.estimate: LensEstimate | None = None
        self._frames = 0
        self._contrary = 0          # number of successive outliers
        self._alone = False         # whether a single frame has determined the lens
        # Observations of the frames that do not determine the lens by themselves.
        self._waiting = np.empty((0, COLUMNS))
        self._average = Average(3, MEMORY)      # of lambda and the centre's x and y

    def add(self, arcs: Arcs, shape: tuple[int, int]) -> None:
        """
        Update the estimate by the arcs of the next frame.

        After the first START frames most frames are ignored: they resemble their neighbours, and
        evaluating each would cost some percent of the time of its detection.

        Parameters
        ----------
        arcs
            The arcs of the frame.
        shape
            (height, width) of the frame, px; the estimate begins anew when it changes.

        """
        if shape != self._shape:
            self._forget(shape)
        self._frames += 1
        if self._frames > START and self._frames % EVERY and not self._contrary:
            return
        seen = informative(observe(arcs, shape))
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
            # Collected frames do not replace a lens that a single frame has determined.
            self._contrary += alone or not self._alone
            if self._contrary < PATIENCE:
                return
            self._forget(shape)
        self._contrary = 0
        self._alone |= alone
        self._take(frame)

    def _is_new_view(self, seen: np.ndarray) -> bool:
        """
        Return whether the observations are of a new view, compared with those that wait.

        Waiting observations of edges that the new view shows again are dropped.
        """
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
        """Return whether a frame contradicts the estimate, by their Mahalanobis distance."""
        if self.estimate is None:
            return False
        free = 3 if self._centre else 1
        off = (_values(frame) - _values(self.estimate))[:free]
        covariance = (frame.covariance + self.estimate.covariance)[:free, :free]
        return bool(off @ np.linalg.solve(covariance, off) > DEVIATIONS[free] ** 2)

    def _take(self, frame: LensEstimate) -> None:
        """Average lambda and centre of a frame with those before."""
        deviations = np.sqrt(np.diag(frame.covariance))
        self._average.add(_values(frame), deviations)
        lam, x, y = self._average.mean.tolist()
        model = replace(frame.model, lam=lam, centre=(x, y) if self._centre else None)
        # The correlations are those of the newest frame.
        scale = self._average.deviations() / np.maximum(deviations, TINY)
        self.estimate = replace(frame, model=model,
                                covariance=frame.covariance * np.outer(scale, scale))


def _values(estimate: LensEstimate) -> np.ndarray:
    """Return lambda and the distortion centre's x and y (px): (3,)."""
    return np.array([estimate.lam, *estimate.model.origin])
