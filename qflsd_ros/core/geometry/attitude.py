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
from qflsd_ros.core.geometry.great_circles import lines, observe, Observed
from qflsd_ros.core.geometry.refinement import (
    CENTRE, Fit, LAMBDA, LOG_FOCAL, Prior, refine)
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
# Deviation of lambda about 0 where arcs do not determine it at all: most lenses.
LENS_SPREAD = 0.2
# Deviation of the optical centre about the distortion centre, half diagonals: that of webcams and
# compact cameras.
CENTRE_SPREAD = 0.03
# Greatest distance of the two, half diagonals: beyond it axes that explain the arcs are wrong ones.
MAX_OFF_CENTRE = 0.1
# Starts that are refined, in order of likelihood; steps of each, and of those that are left; they
# are the same if nothing differs by more than SAME, of axes (radians) and ln f.
STARTS, FIRST_STEPS, STEPS, SAME = 10, 4, 16, 0.02
# Another focal length is a rival if it differs by more than RIVAL in ln f, and its log likelihood
# comes within CLOSE of each arc to the best.
RIVAL, CLOSE = 0.1, 0.15
# Greatest deviation of an observable ln f, and of up (radians).
MAX_FOCAL_STD, MAX_UP_STD = 0.05, math.radians(3.0)
# The deviations of the Hessian count INFLATION times, since neighbouring arcs share their flaws;
# the floors are the flaws of lens and place, which more arcs do not average.  So the ratio of
# error and deviation is 1 on annotated photographs.
INFLATION, FOCAL_FLOOR, UP_FLOOR = 1.5, 0.015, math.radians(0.35)
# Log likelihood for each arc that axes must gain over arcs that point anywhere.
LEAST_GAIN = 0.25


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
        (K, 3) float64 unit vectors in the optical frame: three orthogonal ones, up or down first,
        and further horizontal ones.  Their signs mean nothing.
    labels
        (M,) int64, for each arc the index of its direction, -1 for none.
    lens
        The lens by which directions are rays, from lens and attitude together.
    centre
        (x, y), the optical centre in px of the undistorted image.

    """

    focal: float | None
    focal_std: float | None
    up: np.ndarray | None
    up_std: float | None
    directions: np.ndarray
    labels: np.ndarray
    lens: DivisionModel
    centre: tuple[float, float]


def estimate_attitude(arcs: Arcs, shape: tuple[int, int],
                      lens: LensEstimate | DivisionModel | None = None,
                      focal: float | None = None) -> Attitude | None:
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

    Returns
    -------
    attitude
        None where the arcs do not show three orthogonal directions.  The log has the reason.

    Raises
    ------
    ValueError
        The focal length is not above 0, or the lens is that of images of another size.

    """
    _check(shape, lens, focal)
    model, deviation = _lens(arcs, shape, lens)
    observed = observe(arcs, model)
    if len(observed.arcs) < LEAST_ARCS:
        return _abstain(f'{len(observed.arcs)} arcs, must be at least {LEAST_ARCS}')
    known = None if focal is None else focal / model.half_diagonal
    fits = _fits(observed.seen[:USED], model.lam, deviation, known)
    if not fits:
        return _abstain('no two vanishing points are orthogonal')
    used = min(len(observed.arcs), USED)
    if fits[0].posterior < LEAST_GAIN * used:
        return _abstain(f'axes gain {fits[0].posterior / used:.2f} in log likelihood for each '
                        f'arc, must be at least {LEAST_GAIN}')
    return _attitude(arcs, observed, model, fits, focal)


def _check(shape: tuple[int, int], lens: LensEstimate | DivisionModel | None,
           focal: float | None) -> None:
    """Raise ValueError where arguments contradict each other or themselves."""
    if focal is not None and not 0 < focal < math.inf:
        raise ValueError(f'focal is {focal}: must be above 0 px and finite, or None')
    model = lens.model if isinstance(lens, LensEstimate) else lens
    if model is not None and tuple(model.shape) != tuple(shape):
        raise ValueError(f'lens is that of images of {model.shape}, shape is {tuple(shape)}: '
                         'must be the same (height, width)')


def _abstain(reason: str) -> None:
    logging.getLogger(__name__).info('attitude not observable: %s', reason)


def _lens(arcs: Arcs, shape: tuple[int, int], lens: LensEstimate | DivisionModel | None
          ) -> tuple[DivisionModel, float]:
    """Return the lens to begin with, and the deviation of its lambda."""
    if lens is None:
        lens = estimate_distortion([arcs], shape, max_std=math.inf)
    if lens is None:
        return DivisionModel(0.0, shape), LENS_SPREAD
    if isinstance(lens, DivisionModel):
        return lens, LENS_ERROR * (1 - lens.lam / 3) ** 2
    return lens.model, max(lens.std, LENS_ERROR * (1 - lens.lam / 3) ** 2)


def _fits(seen: np.ndarray, lam: float, deviation: float, focal: float | None) -> list[Fit]:
    """Return local maxima of the posterior, the highest first; ``focal`` in half diagonals."""
    rows = lines(seen, lam)
    focals = FOCALS if focal is None else np.array([focal])
    axes, likelihood = frames(rows, vanishing_points(rows), focals, NONE)
    log_focal, spread = ((LOG_FOCAL_MEAN, LOG_FOCAL_STD) if focal is None
                         else (math.log(focal), GIVEN))
    spreads = np.array([spread, deviation, CENTRE_SPREAD, CENTRE_SPREAD])
    prior = Prior(np.array([log_focal, lam, 0.0, 0.0]), spreads ** -2)
    starts = [np.concatenate([axes[k].ravel(), [math.log(focals[k])], prior.mean[1:]])
              for k in np.argsort(-likelihood)[:STARTS] if np.isfinite(likelihood[k])]
    fits = _distinct([refine(seen, start, prior, FIRST_STEPS) for start in starts], len(seen))
    return _distinct([refine(seen, fit.state, prior, STEPS) for fit in fits], len(seen))


def _order(fit: Fit) -> float:
    return -fit.posterior


def _distinct(fits: list[Fit], count: int) -> list[Fit]:
    """Return the fits that may become the best or a rival, and each only once."""
    near = [fit for fit in fits if np.hypot(*fit.state[CENTRE:]) < MAX_OFF_CENTRE]
    least = max((fit.posterior for fit in near), default=0.0) - 2 * CLOSE * count
    kept: list[Fit] = []
    for fit in sorted(near, key=_order):
        is_new = all(np.abs(fit.state - other.state)[:LAMBDA].max() > SAME for other in kept)
        if fit.posterior >= least and is_new:
            kept.append(fit)
    return kept


class _Focal(NamedTuple):
    """A focal length, px, and its deviation; or why there is none."""

    value: float | None
    std: float | None


def _focal(fits: list[Fit], count: int, unit: float) -> _Focal:
    """Return the focal length of ``count`` arcs if they determine it."""
    best = fits[0]
    log_focal = best.state[LOG_FOCAL]
    std = math.hypot(INFLATION * math.sqrt(best.covariance[3, 3]), FOCAL_FLOOR)
    rivals = [fit for fit in fits if abs(fit.state[LOG_FOCAL] - log_focal) > RIVAL
              and fit.posterior > best.posterior - CLOSE * count]
    if rivals or std > MAX_FOCAL_STD:
        _abstain(f'focal length has a relative deviation of {std:.3f}, must be at most '
                 f'{MAX_FOCAL_STD}, and {len(rivals)} rivals')
        return _Focal(None, None)
    focal = math.exp(log_focal) * unit
    return _Focal(focal, std * focal)


def _up(axes: np.ndarray, fit: Fit) -> tuple[np.ndarray | None, float | None]:
    """Return up and its deviation, if it is determined; axes have the vertical one first."""
    up = -axes[0] * math.copysign(1.0, axes[0, 1])
    turn = np.cross(np.eye(3), up)      # rows: change of up by a rotation about each axis
    spread = np.linalg.eigvalsh(turn.T @ fit.covariance[:3, :3] @ turn)[-1]
    std = math.hypot(INFLATION * math.sqrt(spread), UP_FLOOR)
    if std > MAX_UP_STD:
        _abstain(f'up has a deviation of {math.degrees(std):.1f} degrees, must be at most '
                 f'{math.degrees(MAX_UP_STD):.1f}')
        return None, None
    return up, std


def _attitude(arcs: Arcs, observed: Observed, model: DivisionModel, fits: list[Fit],
              given: float | None) -> Attitude | None:
    """Return the attitude of the best fit, without what is not observable."""
    state = fits[0].state
    axes = state[:9].reshape(3, 3)
    axes = axes[np.argsort(-np.abs(axes[:, 1]), kind='stable')]
    unit, used = model.half_diagonal, min(len(observed.arcs), USED)
    focal = _Focal(given, 0.0) if given is not None else _focal(fits, used, unit)
    up, up_std = _up(axes, fits[0])
    if up is None and focal.value is None:
        return None
    centre = state[CENTRE:]
    camera = np.array([[math.exp(state[LOG_FOCAL]), 0, centre[0]],
                       [0, math.exp(state[LOG_FOCAL]), centre[1]], [0, 0, 1]])
    rows = lines(observed.seen, state[LAMBDA])
    directions = np.concatenate([axes, horizontal(rows, axes, camera)])
    labels = np.full(len(arcs), -1)
    labels[observed.arcs] = _labels(rows, directions @ camera.T)
    return Attitude(focal.value, focal.std, up, up_std, directions, labels,
                    replace(model, lam=float(state[LAMBDA])),
                    tuple((model.origin + centre * unit).tolist()))


def _labels(rows: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return for each line the point that it most likely points to, -1 for none."""
    share = shares(rows, points)
    best = np.argmax(share, axis=0)
    return np.where(share[best, np.arange(len(best))] > 0.5, best, -1)
