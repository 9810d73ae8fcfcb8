"""
The most likely axes, focal length and lens of the arcs of one image, and their rivals.

All lengths are in half diagonals.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.attitude.great_circles import COLUMNS, DEVIATION, lines
from qflsd_ros.core.attitude.refinement import (
    CENTRE, Fit, LAMBDA, LOG_FOCAL, MU, Prior, refine, scale)
from qflsd_ros.core.attitude.vanishing import (
    FOCALS, frames, horizontal, NONE, shares, vanishing_points)

# Prior of ln f in half diagonals: usual lenses, far from excluding any.
LOG_FOCAL_MEAN, LOG_FOCAL_STD = math.log(1.5), 1.0
# Deviation of what is given as exact: of ln f, lambda, mu, and the optical centre.
EXACT = 1e-4
# Deviation of mu at lambda 0, and for lambda 1: -1 / 5 of its square is an equidistant fisheye.
QUARTIC_LEAST, QUARTIC = 0.003, 0.15
# Deviation of the optical centre about the distortion centre, half diagonals of the undistorted
# image: that of webcams and compact cameras, .03, over the root of 2, as arcs count for more than
# independent ones would.
CENTRE_SPREAD = 0.02
# Greatest distance of the two: beyond it axes that explain the arcs are wrong ones.
MAX_OFF_CENTRE = 0.1
# Starts that are refined, in order of likelihood; steps of each, and of those that are left; they
# are the same if nothing differs by more than SAME, of axes (radians) and ln f.
STARTS, FIRST_STEPS, STEPS, SAME = 10, 4, 16, 0.02
# The log likelihood of a rival comes within CLOSE of each arc to the best.
CLOSE = 0.15
# Log likelihood that axes must gain over arcs that point anywhere, for each arc and in all, and
# that a single axis must gain to count: 600 images of random arcs, and 160 of parallel and random
# ones, gained 29 and 9 at most.
GAIN_EACH, GAIN_ALL, GAIN_AXIS = 0.25, 35.0, 10.0


class Unobservable(Exception):
    """The arcs do not show orthogonal directions; the text is the reason."""


class Solution(NamedTuple):
    """
    The most likely axes and cameras for the arcs of an image.

    Attributes
    ----------
    fits
        Local maxima of the posterior, the highest first; at least one.
    seen
        The observations, with deviations that fit their residuals.
    scale
        Factor by which these deviations were multiplied.
    prior
        Prior of all fits.

    """

    fits: list[Fit]
    seen: np.ndarray
    scale: float
    prior: Prior

    @property
    def gain(self) -> float:
        """Return the log likelihood that the best axes gain for each arc."""
        return self.fits[0].posterior / len(self.seen)


def prior_of(lam: float, deviation: float, focal: tuple[float, float] | None, exact: bool = False
             ) -> Prior:
    """
    Return the prior of a lens.

    ``lam`` and ``deviation`` are lambda and its deviation, ``focal`` the same of ln f, if
    anything is known of it; an exact lens has no error beyond these.
    """
    log_focal, spread = focal or (LOG_FOCAL_MEAN, LOG_FOCAL_STD)
    off = EXACT if exact else CENTRE_SPREAD * _stretch(lam)
    quartic = EXACT if exact else QUARTIC_LEAST + QUARTIC * lam ** 2
    spreads = np.array([max(spread, EXACT), max(deviation, EXACT), quartic, off, off])
    return Prior(np.array([log_focal, lam, 0.0, 0.0, 0.0]), spreads ** -2)


def search(seen: np.ndarray, prior: Prior) -> Solution:
    """Return the solution among all axes and focal lengths; Unobservable if there is none."""
    log_focal, lam = prior.mean[:2]
    # A focal length that is known to the spacing of the grid needs no grid.
    known = prior.precision[0] * math.log(FOCALS[1] / FOCALS[0]) ** 2 > 1
    focals = np.array([math.exp(log_focal)]) if known else FOCALS
    return solve(seen, prior, _starts(lines(seen, lam, 0.0), focals, lam))


def solve(seen: np.ndarray, prior: Prior, starts: list[np.ndarray]) -> Solution:
    """Return the solution near any of some states; Unobservable if there is none."""
    fits = _distinct([refine(seen, start, prior, FIRST_STEPS) for start in starts], len(seen))
    if not fits:
        raise Unobservable('no two vanishing points are orthogonal')
    least = max(GAIN_EACH * len(seen), GAIN_ALL)
    if fits[0].posterior < least:
        raise Unobservable(f'axes gain {fits[0].posterior:.1f} in log likelihood, must be at '
                           f'least {least:.1f}')
    factor = scale(seen, fits[0])
    seen = seen.copy()
    seen[:, DEVIATION] *= factor
    fits = _distinct([refine(seen, fit.state, prior, STEPS) for fit in fits], len(seen))
    if not fits:
        raise Unobservable('the optical centre of all axes is far from the distortion centre')
    return Solution(fits, seen, factor, prior)


def warm_up() -> None:
    """Compile the kernels, or load them from the cache, before the first frame comes."""
    seen, prior = np.empty((0, COLUMNS)), prior_of(0.0, 1.0, None)
    rows = lines(seen, 0.0, 0.0)
    _starts(rows, FOCALS, 0.0)
    state = np.concatenate([np.eye(3).ravel(), np.zeros(5)])
    scale(seen, refine(seen, state, prior, 1))
    shares(rows, np.eye(3))
    horizontal(rows, np.eye(3), np.eye(3), np.eye(3)[1:2])


def _stretch(lam: float) -> float:
    """Return by how much undistorting enlarges the image, to first order at its corners."""
    return 1 + abs(lam)


def _starts(rows: np.ndarray, focals: np.ndarray, lam: float) -> list[np.ndarray]:
    """Return states to begin with, one for each of the best focal lengths (half diagonals)."""
    axes, likelihood = frames(rows, vanishing_points(rows), focals, NONE)
    return [np.concatenate([axes[k].ravel(), [math.log(focals[k]), lam, 0.0, 0.0, 0.0]])
            for k in np.argsort(-likelihood)[:STARTS] if np.isfinite(likelihood[k])]


def _distinct(fits: list[Fit], count: int) -> list[Fit]:
    """Return the fits that may become the best or a rival, the best first, each only once."""
    near = [fit for fit in fits if np.hypot(*fit.state[CENTRE:])
            < MAX_OFF_CENTRE * _stretch(fit.state[LAMBDA])]
    least = max((fit.posterior for fit in near), default=0.0) - 2 * CLOSE * count
    kept: list[Fit] = []
    for fit in sorted(near, key=lambda fit: -fit.posterior):
        if fit.posterior < least:
            break
        if all(np.abs(fit.state - other.state)[:LAMBDA].max() > SAME for other in kept):
            kept.append(fit)
    return kept


def supported(solution: Solution) -> Fit:
    """
    Return the best fit, without the arcs along axes that few arcs support.

    Of many arcs, some point along any axis by chance, and would seem to determine it.  Raises
    Unobservable if fewer than two axes are left.
    """
    best = solution.fits[0]
    rows = lines(solution.seen, best.state[LAMBDA], best.state[MU])
    share = shares(rows, axes_of(best.state) @ camera_of(best.state).T)
    # Without an axis, arcs point in none more often.
    none = 1 - share.sum(axis=0)
    gains = -np.log(1 - share + none * (1 - NONE) / (3 * NONE)).sum(axis=1)
    enough = gains > GAIN_AXIS
    if np.count_nonzero(enough) < 2:
        raise Unobservable(f'arcs point in {np.count_nonzero(enough)} of three orthogonal '
                           'directions, must be at least 2')
    counts = enough[share.argmax(axis=0)] | (share.max(axis=0) < 0.5)
    return refine(solution.seen[counts], best.state, solution.prior, 0)


def axes_of(state: np.ndarray) -> np.ndarray:
    """Return the three axes of a state: (3, 3), a row each."""
    return state[:LOG_FOCAL].reshape(3, 3)


def camera_of(state: np.ndarray) -> np.ndarray:
    """Return the matrix K that maps directions to vanishing points, half diagonals: (3, 3)."""
    focal = math.exp(state[LOG_FOCAL])
    return np.array([[focal, 0, state[CENTRE]], [0, focal, state[CENTRE + 1]], [0, 0, 1]])


def curved(fit: Fit) -> float:
    """Return how strong the distortion is, 0 to 1."""
    return abs(fit.state[LAMBDA]) / _stretch(fit.state[LAMBDA])
