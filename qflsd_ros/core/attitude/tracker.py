"""
The attitude of a camera over time: axes that keep their order, and one focal length.

The solution of the last frame is refined on the next one.  A full search follows where that
explains the arcs worse than before, where the view has changed, and now and then.  Each search
measures the focal length anew.  Measurements of different views are averaged: the same edges in
the same place have the same errors, however often they are seen.
"""
from __future__ import annotations

from dataclasses import replace
from itertools import permutations
import math

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.attitude import solution as solutions
from qflsd_ros.core.attitude.estimation import (
    arranged, Attitude, describe, direction, focal_of, used)
from qflsd_ros.core.attitude.great_circles import COLUMNS
from qflsd_ros.core.attitude.labels import TrackLabels
from qflsd_ros.core.attitude.solution import (
    axes_of, search, Solution, solve, supported, Unobservable)
from qflsd_ros.core.attitude.vanishing import horizontal
from qflsd_ros.core.attitude.view import Lens, shows_the_same, View, view_of
from qflsd_ros.core.averaging import Average

# Views after which one counts 1 / e, as for the lens.
MEMORY = 100
# A view is new if the camera has turned by TURN (radians), or if it shows other arcs.  Chosen, not
# tuned: at TURN an edge moves by some times the width of the blur.
TURN = math.radians(3.0)
# A solution is lost if its gain for each arc falls below this share of the last search's.
KEPT = 0.7
# Frames after which a search looks for a better solution of the same view: 1 s at 30 Hz.
EVERY = 30
# Frames without axes after which up is again the axis closest to the hint: 1 s at 30 Hz, in which
# a camera may turn by 45 degrees.
GAP = 30
# Solutions that are followed while the focal length is unknown: more seldom come near the best.
FOLLOWED = 3
# Angle to the last axes within which a solution that is nearly the best is preferred to the best:
# more than a camera turns from one frame to the next.
NEXT = math.radians(15.0)
# Log likelihood for each arc by which such a solution may be worse.  Tuned on two
# views of the rendered room: wrong ones were worse by .06 to .17, and better by .04 at most.
NEARLY = 0.05
# Normalised distance from which on a focal length is an outlier: normally distributed errors
# exceed it once in 16000 frames; and successive outliers after which it is taken to have changed.
DEVIATIONS, PATIENCE = 4.0, 15
ORDERS = np.array(list(permutations(range(3))))


class AttitudeTracker:
    """
    Estimates attitude and focal length from frame to frame.

    Parameters
    ----------
    up_hint
        Approximate direction of up in the first frame, see :func:`estimate_attitude`.

    Attributes
    ----------
    attitude
        That of the last frame, None where its arcs do not show one.  Its axes form a right-handed
        frame and keep order and sign from frame to frame: yaw is continuous.  Its focal length is
        the average over views, None before the first one that determines it.  An arc with a track
        keeps its label unless another one is clearly more likely by the last frames.
    reason
        Why ``attitude`` is None; empty where it is not.
    outliers
        Number of focal lengths that were ignored because they contradict the average.

    Raises
    ------
    ValueError
        The hint has no direction.

    """

    def __init__(self, up_hint: tuple[float, float, float] = (0.0, -1.0, 0.0)) -> None:
        self._hint = direction(up_hint)
        self.outliers = 0
        self._forget((0, 0))

    def _forget(self, shape: tuple[int, int]) -> None:
        """Begin anew, with frames of a shape."""
        self._shape = shape
        self.attitude: Attitude | None = None
        self.reason = 'no frame yet'
        self._log_focal = Average(1, MEMORY)        # in half diagonals
        self._why_no_focal: tuple[str, ...] = ()
        self._contrary = 0                          # successive outliers
        self._missed = 0                            # successive frames without axes
        self._states: list[np.ndarray] = []         # of the last solution
        self._axes: np.ndarray | None = None        # the last ones, (3, 3) rows, in their order
        self._further = np.empty((0, 3))            # further directions, by those axes
        self._common = 3            # directions that are the same as in the frame before
        self._labels = TrackLabels()
        # The last search: observations, axes, gain for each arc, and frames since.
        self._searched: np.ndarray | None = None
        self._searched_axes = np.zeros((3, 3))
        self._gain, self._since = 0.0, 0

    @property
    def focal(self) -> tuple[float, float] | None:
        """Return the average focal length and its deviation, px; None before the first."""
        if not self._log_focal:
            return None
        focal = math.exp(self._log_focal.mean[0]) * math.hypot(*self._shape) / 2
        return focal, focal * float(self._log_focal.deviations()[0])

    def add(self, arcs: Arcs, shape: tuple[int, int], lens: Lens = None,
            focal: float | None = None) -> Attitude | None:
        """
        Return the attitude of the next frame.

        Parameters
        ----------
        arcs, shape, lens, focal
            Those of :func:`estimate_attitude`.  The tracker begins anew when the shape changes.

        """
        if shape != self._shape:
            self._forget(shape)
        view = view_of(arcs, shape, lens, focal)
        try:
            self.attitude, self.reason = self._follow(view, arcs), ''
            self._missed = 0
        except Unobservable as error:
            self.attitude, self.reason = None, str(error)
            self._missed += 1
        return self.attitude

    def _follow(self, view: View, arcs: Arcs) -> Attitude:
        """Return the attitude of a view, from the last solution or a search."""
        seen = used(view)
        if self._missed > GAP:      # the axes may come back in another order
            self._further, self._labels = np.empty((0, 3)), TrackLabels()
        solution = self._refined(seen, view)
        new = solution is None or self._is_new(seen, axes_of(solution.fits[0].state))
        lost = solution is None or solution.gain < KEPT * self._gain
        self._since += 1
        if solution is None or new or lost or self._contrary or self._since >= EVERY:
            solution = self._search(seen, view, new)
        found = describe(solution, self._with_focal(view), self._arranged, self._horizontal,
                         lambda chances: self._labels.follow(arcs, chances, self._common))
        # Rivals are followed as long as the focal length does not decide between them.
        self._states = [fit.state for fit in solution.fits[:1 if self._log_focal else FOLLOWED]]
        self._axes = found.directions[:3]
        if view.focal is None and not self._log_focal:
            found = replace(found, focal=None, focal_std=None, reasons=self._why_no_focal)
        return found

    def _horizontal(self, rows: np.ndarray, axes: np.ndarray, camera: np.ndarray) -> np.ndarray:
        """Return further directions: those of the last frame, and others after a search."""
        known = self._further @ axes
        self._common = 3 + len(known)
        if self._since:
            return known
        found = horizontal(rows, axes, camera, known)
        if not np.array_equal(found[:len(known)], known):
            self._common = 3
        self._further = found @ axes.T
        return found

    def _with_focal(self, view: View) -> View:
        """Return the view with the average focal length, if it has none of its own."""
        if view.focal is not None or not self._log_focal:
            return view
        return view._replace(focal=(float(self._log_focal.mean[0]),
                                    float(self._log_focal.deviations()[0])))

    def _refined(self, seen: np.ndarray, view: View) -> Solution | None:
        """Return the solution near the last one, None if there is none."""
        if not self._states or self._missed:
            return None
        try:
            return self._nearest(solve(seen, self._with_focal(view).prior(), self._states))
        except Unobservable:
            return None

    def _search(self, seen: np.ndarray, view: View, new: bool) -> Solution:
        """Return the best solution of a view, and average the focal length of a new one."""
        solution = self._nearest(search(seen, view.prior()))
        if view.focal is None:
            self._measure(solution, view, new)
            known = self._with_focal(view)
            if known.focal is not None:
                starts = [fit.state for fit in solution.fits]
                solution = self._nearest(solve(seen, known.prior(), starts))
        if new:
            self._searched, self._searched_axes = seen, axes_of(solution.fits[0].state)
        self._gain, self._since = solution.gain, 0
        return solution

    def _measure(self, solution: Solution, view: View, new: bool) -> None:
        """Average the focal length of a solution, if it is observable there."""
        focal, focal_std, why_not = focal_of(solution, supported(solution), view)
        if focal is None or focal_std is None:
            self._why_no_focal = (why_not,)
            return
        value, std = math.log(focal / view.lens.half_diagonal), focal_std / focal
        if self._log_focal:
            off = value - self._log_focal.mean[0]
            if abs(off) > DEVIATIONS * math.hypot(std, self._log_focal.deviations()[0]):
                self.outliers += 1
                self._contrary += 1
                if self._contrary < PATIENCE:
                    return
                self._log_focal = Average(1, MEMORY)
        self._contrary = 0
        if new or not self._log_focal:
            self._log_focal.add(np.array([value]), np.array([std]))

    def _is_new(self, seen: np.ndarray, axes: np.ndarray) -> bool:
        """Return whether a view differs from that of the last search of a new one."""
        if self._searched is None:
            return True
        if _angle(axes, self._searched_axes) > TURN:
            return True
        return not shows_the_same(seen, self._searched)

    def _nearest(self, solution: Solution) -> Solution:
        """Return a solution whose first fit is near the last axes, if one is nearly the best."""
        if self._axes is None or self._missed > GAP:
            return solution
        last, fits = self._axes, solution.fits
        least = fits[0].posterior - NEARLY * len(solution.seen)
        off = [_angle(matched(axes_of(fit.state), last), last) if fit.posterior > least
               else math.inf for fit in fits]
        best = int(np.argmin(off))
        if off[best] > NEXT:
            return solution
        return solution._replace(fits=[fits[best], *fits[:best], *fits[best + 1:]])

    def _arranged(self, axes: np.ndarray) -> np.ndarray:
        """Return axes in the order and with the signs of the last ones, right-handed."""
        first = self._axes is None or self._missed > GAP
        if self._axes is not None:
            axes = matched(axes, self._axes)
        if first:
            axes = arranged(axes, self._hint)
        return axes if np.linalg.det(axes) > 0 else axes[[0, 2, 1]]


def matched(axes: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return axes, rows of (3, 3), ordered and with signs so as to be nearest to the last ones."""
    cosines = last @ axes.T
    order = ORDERS[np.abs(cosines[range(3), ORDERS]).sum(axis=1).argmax()]
    return axes[order] * np.sign(cosines[range(3), order])[:, None]


def _angle(axes: np.ndarray, others: np.ndarray) -> float:
    """Return the angle of the rotation between axes of the same order and signs, radians."""
    cosine = (float((axes * others).sum()) - 1) / 2
    return math.acos(min(max(cosine, -1.0), 1.0))


def warm_up() -> None:
    """Compile the kernels, or load them from the cache, before the first frame comes."""
    solutions.warm_up()
    shows_the_same(np.empty((0, COLUMNS)), np.empty((0, COLUMNS)))
