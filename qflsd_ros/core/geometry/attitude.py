"""
Attitude of a camera from one image: three orthogonal directions, up, and the focal length.

Man-made places have most of their edges in three orthogonal directions.  The images of parallel
edges meet in a vanishing point; two of them that are orthogonal and finite determine the focal
length, all three the rotation of the camera against the place.  Stages:

    arcs -> observations (great_circles) -> vanishing points, without a focal length (vanishing)
         -> the best axes for each of a grid of focal lengths (vanishing)
         -> rotation, ln f, lambda, optical centre on all arcs (refinement)
         -> observable? -> up, labels, further horizontal directions

The estimate abstains: no focal length where its deviation is large or another one explains the
arcs nearly as well, no attitude where the arcs agree no better than arcs at random.
"""
from __future__ import annotations

from dataclasses import dataclass, replace
import logging
import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.geometry.great_circles import (
    DEVIATION, KNOT, lines, observe, Observed, PRECISION, SHARPNESS)
from qflsd_ros.core.geometry.refinement import (
    CENTRE, Fit, LAMBDA, LOG_FOCAL, MU, Prior, refine, scale)
from qflsd_ros.core.geometry.vanishing import (
    FOCALS, frames, horizontal, NONE, shares, vanishing_points)
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.lens.estimation import estimate_distortion, LENS_ERROR, LensEstimate

# The longest arcs that the estimate is made of: with 100 focal lengths have twice the error, with
# 400 the same.
USED = 200
# Least number of arcs: three directions and the focal length have four unknowns, and a wrong mode
# won in images of fewer arcs.
LEAST_ARCS = 12
# Prior of ln f in half diagonals: usual lenses, far from excluding any.
LOG_FOCAL_MEAN, LOG_FOCAL_STD = math.log(1.5), 1.0
# Deviation of a focal length that was given, relative.
GIVEN = 1e-4
# Deviation of lambda beyond that of its estimate, over the same root and more, times
# (1 - lambda / 3)^2, by which the same change bends lines less.
LENS_FLAW = LENS_ERROR / 2
# Deviation of lambda about 0 where arcs do not determine it at all: most lenses.
LENS_SPREAD = 0.2
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
# Another focal length is a rival if it differs by more than RIVAL in ln f, and its log likelihood
# comes within CLOSE of each arc to the best.
RIVAL, CLOSE = 0.1, 0.15
# Greatest deviation of an observable ln f, and of up (radians).
MAX_FOCAL_STD, MAX_UP_STD = 0.07, math.radians(3.0)
# Errors that arcs share and more of them do not average: places are not quite orthogonal, lenses
# not quite division models.  They grow with the square of the scatter of arcs, that of annotated
# photographs being about .7: of ln f and of up (radians), and of both times lambda over
# 1 + |lambda|.  Chosen so that
# errors are one deviation there; on a rendered room, where nothing is shared, they are less.
SHARED_FOCAL, SHARED_FOCAL_LENS = 0.04, 0.18
SHARED_UP, SHARED_UP_LENS = math.radians(1.1), math.radians(2.4)
# Log likelihood that axes must gain over arcs that point anywhere, for each arc and in all, and
# that a single axis must gain to count: 600 images of random arcs, and 160 of parallel and random
# ones, gained 29 and 9 at most.
GAIN_EACH, GAIN_ALL, GAIN_AXIS = 0.25, 35.0, 10.0


@dataclass(frozen=True)
class Attitude:
    """
    Attitude and focal length of a camera, with their uncertainty.

    Attributes
    ----------
    focal
        Focal length in px at the distortion centre, or None where it is not observable.
    focal_std
        Its standard deviation, px; None with the focal length, 0 where that was given.
    up
        (3,) float64 unit vector upwards in the optical frame (x right, y down, z forward), or
        None where it is not observable.
    up_std
        Standard deviation of its direction, radians, on the worse side; None without it.
    directions
        (K, 3) float64 unit vectors in the optical frame: three orthogonal ones, the vertical one
        first, and further horizontal ones.  The first one points up, all others forward.
    labels
        (M,) int64, for each arc the index of its direction, -1 for none.
    lens
        The lens, from the curvature of arcs and their directions together; its lambda is that of
        :meth:`rays`.
    mu
        What the lens leaves of the division model, see :mod:`great_circles`.
    camera
        (3, 3) float64, from directions to homogeneous px of the undistorted image, relative to the
        distortion centre: the most likely focal length, observable or not, and optical centre.

    """

    focal: float | None
    focal_std: float | None
    up: np.ndarray | None
    up_std: float | None
    directions: np.ndarray
    labels: np.ndarray
    lens: DivisionModel
    mu: float
    camera: np.ndarray

    def rays(self, points: np.ndarray) -> np.ndarray:
        """
        Return the directions in which pixels look.

        Parameters
        ----------
        points
            (..., 2) px, (0, 0) at the centre of the top-left pixel.

        Returns
        -------
        rays
            (..., 3) float64 unit vectors in the optical frame.

        """
        unit = self.lens.half_diagonal
        p = (np.asarray(points, float) - self.lens.origin) / unit
        square = (p ** 2).sum(axis=-1, keepdims=True)
        w = 1 + square * (self.lens.lam + self.mu * (square - KNOT))
        rays = np.concatenate([p * unit, w], axis=-1) @ np.linalg.inv(self.camera).T
        return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


class _Solution(NamedTuple):
    """
    What the arcs of an image say.

    Attributes
    ----------
    fits
        Local maxima of the posterior, the highest first; at least one.
    seen
        The observations, with deviations that fit their residuals.
    scale
        The factor of these.
    prior
        Of all fits.

    """

    fits: list[Fit]
    seen: np.ndarray
    scale: float
    prior: Prior


def estimate_attitude(arcs: Arcs, shape: tuple[int, int],
                      lens: LensEstimate | DivisionModel | None = None,
                      focal: float | None = None, *,
                      up_hint: tuple[float, float, float] = (0.0, -1.0, 0.0)) -> Attitude | None:
    """
    Estimate attitude and focal length from the arcs of one image.

    Parameters
    ----------
    arcs
        The arcs of the image.
    shape
        (height, width) of the image, px.
    lens
        The lens: an estimate, whose deviation counts, or a known one.  None: the arcs themselves
        determine it, as far as they can.
    focal
        Focal length in px at the distortion centre if it is known, else None.
    up_hint
        About where up is in the optical frame (x right, y down, z forward): up is the axis
        closest to it, within 45 degrees at best.

    Returns
    -------
    attitude
        None where the arcs do not show orthogonal directions.  The log has the reason.

    Raises
    ------
    ValueError
        The focal length is not above 0, the lens is that of images of another size, or the hint
        has no direction.

    """
    _check(shape, lens, focal, up_hint)
    model, deviation = _lens(arcs, shape, lens)
    observed = observe(arcs, model)
    if len(observed.arcs) < LEAST_ARCS:
        _abstain(f'{len(observed.arcs)} arcs, must be at least {LEAST_ARCS}')
        return None
    known = None if focal is None else focal / model.half_diagonal
    solution = _solve(observed.seen[:USED], model.lam, deviation, known)
    if solution is None:
        return None
    return _attitude(solution, _Image(observed, len(arcs), model, focal), np.array(up_hint, float))


def _check(shape: tuple[int, int], lens: LensEstimate | DivisionModel | None,
           focal: float | None, up_hint: tuple[float, float, float]) -> None:
    """Raise ValueError where arguments contradict each other or themselves."""
    if focal is not None and not 0 < focal < math.inf:
        raise ValueError(f'focal is {focal}: must be above 0 px and finite, or None')
    if not 0 < math.hypot(*up_hint) < math.inf:
        raise ValueError(f'up_hint is {tuple(up_hint)}: must be finite and have a direction')
    model = lens.model if isinstance(lens, LensEstimate) else lens
    if model is not None and tuple(model.shape) != tuple(shape):
        raise ValueError(f'lens is that of images of {tuple(model.shape)}, shape is '
                         f'{tuple(shape)}: must be the same (height, width)')


def _abstain(reason: str) -> None:
    logging.getLogger(__name__).info('attitude not observable: %s', reason)


def _lens(arcs: Arcs, shape: tuple[int, int], lens: LensEstimate | DivisionModel | None
          ) -> tuple[DivisionModel, float]:
    """Return the lens to begin with, and the deviation of its lambda."""
    if lens is None:
        lens = estimate_distortion([arcs], shape, max_std=math.inf)
    if lens is None:
        return DivisionModel(0.0, shape), LENS_SPREAD
    model, std = (lens, 0.0) if isinstance(lens, DivisionModel) else (lens.model, lens.std / 2)
    return model, max(std, LENS_FLAW * (1 - model.lam / 3) ** 2)


def _solve(seen: np.ndarray, lam: float, deviation: float, focal: float | None
           ) -> _Solution | None:
    """
    Return the most likely axes, focal lengths and lenses, if arcs agree on any.

    ``lam`` and ``deviation`` are a prior of lambda; the focal length, if known, is in half
    diagonals.
    """
    log_focal, spread = ((LOG_FOCAL_MEAN, LOG_FOCAL_STD) if focal is None
                         else (math.log(focal), GIVEN))
    off = CENTRE_SPREAD * _stretch(lam)
    spreads = np.array([spread, deviation, QUARTIC_LEAST + QUARTIC * lam ** 2, off, off])
    prior = Prior(np.array([log_focal, lam, 0.0, 0.0, 0.0]), spreads ** -2)
    starts = _starts(lines(seen, lam, 0.0), FOCALS if focal is None else np.array([focal]), lam)
    fits = _distinct([refine(seen, start, prior, FIRST_STEPS) for start in starts], len(seen))
    if not fits:
        _abstain('no two vanishing points are orthogonal')
        return None
    least = max(GAIN_EACH * len(seen), GAIN_ALL)
    if fits[0].posterior < least:
        _abstain(f'axes gain {fits[0].posterior:.1f} in log likelihood, must be at least '
                 f'{least:.1f}')
        return None
    factor = scale(seen, fits[0])
    seen = seen.copy()
    seen[:, DEVIATION] *= factor
    fits = _distinct([refine(seen, fit.state, prior, STEPS) for fit in fits], len(seen))
    return _Solution(fits, seen, factor, prior) if fits else None


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


class _Image(NamedTuple):
    """Observations of an image, the number of its arcs, its lens, its focal length if given."""

    observed: Observed
    arcs: int
    lens: DivisionModel
    focal: float | None


def _attitude(solution: _Solution, image: _Image, hint: np.ndarray) -> Attitude | None:
    """Return the attitude of the best fit, without what is not observable."""
    fit, supported = _supported(solution)
    if np.count_nonzero(supported) < 2:
        _abstain(f'arcs point in {np.count_nonzero(supported)} of three orthogonal '
                 'directions, must be at least 2')
        return None
    state, scatter = fit.state, solution.scale ** 2
    axes = _arranged(_axes(state), hint)
    focal, focal_std = _focal(solution, fit, image)
    up_std = _up_std(axes[0], fit, scatter)
    if focal is None and up_std is None:
        return None
    camera, unit = _camera(state), image.lens.half_diagonal
    rows = lines(image.observed.seen, state[LAMBDA], state[MU])
    rows[SHARPNESS] /= solution.scale
    rows[PRECISION] /= scatter
    directions = np.concatenate([axes, horizontal(rows, axes, camera)])
    labels = np.full(image.arcs, -1)
    labels[image.observed.arcs] = _labels(rows, directions @ camera.T)
    return Attitude(focal, focal_std, None if up_std is None else axes[0], up_std,
                    directions, labels, replace(image.lens, lam=float(state[LAMBDA])),
                    float(state[MU]), np.diag([unit, unit, 1.0]) @ camera)


def _supported(solution: _Solution) -> tuple[Fit, np.ndarray]:
    """
    Return the best fit without the arcs of axes that few point to, and which axes count, (3,).

    Some of many arcs point along any axis by chance, and would determine it.
    """
    best = solution.fits[0]
    rows = lines(solution.seen, best.state[LAMBDA], best.state[MU])
    share = shares(rows, _axes(best.state) @ _camera(best.state).T)
    # Without an axis, arcs point in none more often.
    none = 1 - share.sum(axis=0)
    gains = -np.log(1 - share + none * (1 - NONE) / (3 * NONE)).sum(axis=1)
    supported = gains > GAIN_AXIS
    counts = supported[share.argmax(axis=0)] | (share.max(axis=0) < 0.5)
    return refine(solution.seen[counts], best.state, solution.prior, 0), supported


def _axes(state: np.ndarray) -> np.ndarray:
    return state[:LOG_FOCAL].reshape(3, 3)


def _camera(state: np.ndarray) -> np.ndarray:
    """Return K, from directions to vanishing points in half diagonals: (3, 3)."""
    focal = math.exp(state[LOG_FOCAL])
    return np.array([[focal, 0, state[CENTRE]], [0, focal, state[CENTRE + 1]], [0, 0, 1]])


def _arranged(axes: np.ndarray, hint: np.ndarray) -> np.ndarray:
    """Return the axes, the one that is closest to the hint first; it points up, others forward."""
    axes = axes[np.argsort(-np.abs(axes @ hint), kind='stable')]
    signs = np.where(axes[:, 2] < 0, -1.0, 1.0)
    signs[0] = math.copysign(1.0, axes[0] @ hint)
    return axes * signs[:, None]


def _focal(solution: _Solution, fit: Fit, image: _Image) -> tuple[float | None, float | None]:
    """Return the focal length and its deviation, px, if it is given or observable."""
    if image.focal is not None:
        return image.focal, 0.0
    log_focal = fit.state[LOG_FOCAL]
    shared = solution.scale ** 2 * math.hypot(SHARED_FOCAL, SHARED_FOCAL_LENS * _curved(fit))
    std = math.hypot(math.sqrt(fit.covariance[3, 3]), shared)
    least = solution.fits[0].posterior - CLOSE * len(solution.seen)
    rivals = [other for other in solution.fits if other.posterior > least
              and abs(other.state[LOG_FOCAL] - log_focal) > RIVAL]
    if rivals or std > MAX_FOCAL_STD:
        _abstain(f'focal length has a relative deviation of {std:.3f}, must be at most '
                 f'{MAX_FOCAL_STD}, and {len(rivals)} rivals')
        return None, None
    focal = math.exp(log_focal) * image.lens.half_diagonal
    return focal, std * focal


def _curved(fit: Fit) -> float:
    """Return how strong the distortion is, 0 to 1."""
    return abs(fit.state[LAMBDA]) / _stretch(fit.state[LAMBDA])


def _up_std(up: np.ndarray, fit: Fit, scatter: float) -> float | None:
    """Return the deviation of up on its worse side, radians, if it is observable."""
    turn = np.cross(np.eye(3), up)      # rows: change of up by a rotation about each axis
    variance = np.linalg.eigvalsh(turn.T @ fit.covariance[:3, :3] @ turn)[-1]
    shared = scatter * math.hypot(SHARED_UP, SHARED_UP_LENS * _curved(fit))
    std = math.hypot(math.sqrt(variance), shared)
    if std > MAX_UP_STD:
        _abstain(f'up has a deviation of {math.degrees(std):.1f} degrees, must be at most '
                 f'{math.degrees(MAX_UP_STD):.1f}')
        return None
    return std


def _labels(rows: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return for each line the point that it most likely points to, -1 for none."""
    share = shares(rows, points)
    best = np.argmax(share, axis=0)
    return np.where(share[best, np.arange(len(best))] > 0.5, best, -1)
