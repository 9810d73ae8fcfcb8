"""
Attitude of a camera from one image: three orthogonal directions, up, and the focal length.

Man-made places have most of their edges in three orthogonal directions.  The images of parallel
edges meet in a vanishing point; two of them that are orthogonal and finite determine the focal
length, all three the rotation of the camera against the place.  Stages:

    arcs -> observations (view, great_circles)
         -> vanishing points, without a focal length (vanishing)
         -> the best axes for each of a grid of focal lengths (vanishing)
         -> rotation, ln f, lambda, optical centre on all arcs (solution, refinement)
         -> observable? -> up, labels, further horizontal directions

The estimate abstains: no focal length where its deviation is large or another one explains the
arcs nearly as well, no attitude where the arcs agree no better than arcs at random.
"""
from __future__ import annotations

from dataclasses import dataclass, replace
import logging
import math
from typing import Callable

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.attitude.great_circles import KNOT, lines, PRECISION, SHARPNESS
from qflsd_ros.core.attitude.refinement import Fit, LAMBDA, LOG_FOCAL, MU
from qflsd_ros.core.attitude.solution import (
    axes_of, camera_of, CLOSE, curved, EXACT, search, Solution, supported, Unobservable)
from qflsd_ros.core.attitude.vanishing import horizontal, shares
from qflsd_ros.core.attitude.view import Lens, View, view_of
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.division import DivisionModel

# The longest arcs that the estimate is made of: with 100 focal lengths have twice the error, with
# 400 the same.
USED = 200
# Least number of arcs: three directions and the focal length have four unknowns, and a wrong mode
# won in images of fewer arcs.
LEAST_ARCS = 12
# Another focal length is a rival if it differs by more than RIVAL in ln f.
RIVAL = 0.1
# Greatest deviation of an observable ln f, and of up (radians).  Chosen on York Urban: with .045 a
# seventh of the focal lengths is lost, with .065 one of 220 is wrong by a half.
MAX_FOCAL_STD, MAX_UP_STD = 0.055, math.radians(3.0)
# Rivals widen the deviation of up: one that is worse by CLOSE for each arc counts exp(-DOUBT) as
# much as the best, since neighbouring arcs share errors.  On York Urban normalised errors change
# by less than .05 between 3 and 10.  Axes farther apart than NEAR_UP are different ones.
DOUBT, NEAR_UP = 3.0, math.radians(15.0)
# Errors that arcs share and more of them do not average: places are not quite orthogonal, lenses
# not quite division models.  They grow with the square of the scatter of arcs, that of annotated
# photographs being about .5: of ln f and of up (radians), and of both times lambda over
# 1 + |lambda|.  Chosen so that errors are one deviation there; on a rendered room, where
# nothing is shared, they are less.
SHARED_FOCAL, SHARED_FOCAL_LENS = 0.075, 0.26
# The same for up, chosen in the same way.
SHARED_UP, SHARED_UP_LENS = math.radians(2.0), math.radians(4.0)


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
        Its standard deviation, radians, towards the less certain side; None if up is None.
    directions
        (K, 3) float64 unit vectors in the optical frame: three orthogonal ones, the vertical one
        first, and further horizontal ones.  The first one points up, all others forward.
    labels
        (M,) int64, for each arc the index of its direction, -1 for none.
    lens
        The lens, from the curvature of arcs and their directions together; its lambda is that of
        :meth:`rays`.
    mu
        Deviation of the lens from the division model, see :mod:`great_circles`.
    camera
        (3, 3) float64 camera matrix: maps directions to homogeneous px of the undistorted image,
        relative to the distortion centre.  It has the optical centre, and the most likely focal
        length even where that is not observable.
    calibration
        The calibrated camera if that was given: then ``lens`` and ``camera`` are those of the
        stereographic camera of the same focal length, and ``rays`` are the calibration's.
    reasons
        Why the focal length or up is None.

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
    calibration: CameraModel | None = None
    reasons: tuple[str, ...] = ()

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
        if self.calibration is not None:
            return self.calibration.rays(np.asarray(points, float))
        unit = self.lens.half_diagonal
        p = (np.asarray(points, float) - self.lens.origin) / unit
        square = (p ** 2).sum(axis=-1, keepdims=True)
        w = 1 + square * (self.lens.lam + self.mu * (square - KNOT))
        rays = np.concatenate([p * unit, w], axis=-1) @ np.linalg.inv(self.camera).T
        return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def estimate_attitude(arcs: Arcs, shape: tuple[int, int],
                      lens: Lens = None,
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
        The lens: an estimate, whose deviation counts, or a known one, or a calibrated camera with
        its focal length.  None: the arcs themselves determine it, as far as they can.
    focal
        Focal length in px at the distortion centre if it is known, else None.
    up_hint
        Approximate direction of up in the optical frame (x right, y down, z forward).  The axis
        closest to it is taken for up, so that it must be right to within 45 degrees.

    Returns
    -------
    attitude
        None where the arcs do not show orthogonal directions.  The log has the reason.

    Raises
    ------
    ValueError
        The focal length is not above 0 or is given beside a calibration, the lens is that of
        images of another size, or the hint has no direction.

    """
    try:
        found = attitude_of(arcs, shape, lens, focal, up_hint)
    except Unobservable as error:
        _abstain(str(error))
        return None
    for reason in found.reasons:
        _abstain(reason)
    return found


def attitude_of(arcs: Arcs, shape: tuple[int, int], lens: Lens, focal: float | None,
                up_hint: tuple[float, float, float]) -> Attitude:
    """Return what :func:`estimate_attitude` does; instead of None, raise Unobservable."""
    hint = direction(up_hint)
    view = view_of(arcs, shape, lens, focal)
    return describe(search(used(view), view.prior()), view, lambda axes: arranged(axes, hint))


def directions(arcs: Arcs, attitude: Attitude | None) -> np.ndarray:
    """Return the label of each arc in its attitude: (M,) int64, -1 for none, and without one."""
    return np.full(len(arcs), -1) if attitude is None else attitude.labels


def with_directions(arcs: Arcs, attitude: Attitude | None) -> Arcs:
    """Return the arcs with their :func:`directions` in the column ``direction`` of the table."""
    return arcs.with_columns(direction=directions(arcs, attitude))


def direction(up_hint: tuple[float, float, float]) -> np.ndarray:
    """Return the hint as (3,) float64; ValueError if it has no direction."""
    if not 0 < math.hypot(*up_hint) < math.inf:
        raise ValueError(f'up_hint is {tuple(up_hint)}: must be finite and have a direction')
    return np.array(up_hint, float)


def _abstain(reason: str) -> None:
    logging.getLogger(__name__).info('attitude not observable: %s', reason)


def used(view: View) -> np.ndarray:
    """Return the observations of the longest arcs; raise Unobservable if they are too few."""
    count = len(view.observed.arcs)
    if count < LEAST_ARCS:
        raise Unobservable(f'{count} arcs, must be at least {LEAST_ARCS}')
    return view.observed.seen[:USED]


def most_likely(probabilities: np.ndarray) -> np.ndarray:
    """
    Return the most likely direction of each arc, (M,) int64: -1 if it is less likely than 1/2.

    ``probabilities``, (M, K), are those of arc i to point in direction k.
    """
    best = np.argmax(probabilities, axis=1)
    return np.where(probabilities[np.arange(len(best)), best] > 0.5, best, -1)


def describe(solution: Solution, view: View, arrange: Callable[[np.ndarray], np.ndarray],
             further: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray] = horizontal,
             label: Callable[[np.ndarray], np.ndarray] = most_likely) -> Attitude:
    """
    Return the attitude of the best fit; focal length or up is None if it is not observable.

    Parameters
    ----------
    solution
        Its first fit is the best one.
    view
        The arcs and what is known of the camera.
    arrange
        Orders axes, rows of (3, 3), and chooses their signs.
    further
        Returns more directions, as :func:`horizontal`.
    label
        Returns labels from probabilities, as :func:`most_likely`.

    Raises
    ------
    Unobservable
        Neither focal length nor up are observable.

    """
    fit = supported(solution)
    state, scatter = fit.state, solution.scale ** 2
    axes = arrange(axes_of(state))
    focal, focal_std, why_not = focal_of(solution, fit, view)
    up_std, why_not_up = _up_std(axes[0], fit, solution)
    reasons = tuple(reason for reason in (why_not, why_not_up) if reason)
    if focal is None and up_std is None:
        raise Unobservable(', and '.join(reasons))
    camera, unit = camera_of(state), view.lens.half_diagonal
    rows = lines(view.observed.seen, state[LAMBDA], state[MU])
    rows[SHARPNESS] /= solution.scale
    rows[PRECISION] /= scatter
    directions = np.concatenate([axes, further(rows, axes, camera)])
    probabilities = np.zeros((view.arcs, len(directions)))
    probabilities[view.observed.arcs] = shares(rows, directions @ camera.T).T
    return Attitude(focal, focal_std, None if up_std is None else axes[0], up_std,
                    directions, label(probabilities),
                    replace(view.lens, lam=float(state[LAMBDA])),
                    float(state[MU]), np.diag([unit, unit, 1.0]) @ camera, view.calibration,
                    reasons)


def arranged(axes: np.ndarray, hint: np.ndarray) -> np.ndarray:
    """
    Return axes, rows of (3, 3), in order and with signs.

    The axis closest to the hint comes first and points up; the others point forward.
    """
    axes = axes[np.argsort(-np.abs(axes @ hint), kind='stable')]
    signs = np.where(axes[:, 2] < 0, -1.0, 1.0)
    signs[0] = math.copysign(1.0, axes[0] @ hint)
    return axes * signs[:, None]


def focal_of(solution: Solution, fit: Fit, view: View
             ) -> tuple[float | None, float | None, str]:
    """Return the focal length and its deviation, px, if observable; or the reason why not."""
    unit = view.lens.half_diagonal
    if view.focal is not None:
        focal = math.exp(view.focal[0]) * unit
        # The prior of an exact one is not quite.
        return focal, focal * view.focal[1] if view.focal[1] > EXACT else 0.0, ''
    std = log_focal_std(solution, fit)
    log_focal = fit.state[LOG_FOCAL]
    least = solution.fits[0].posterior - CLOSE * len(solution.seen)
    rivals = [other for other in solution.fits if other.posterior > least
              and abs(other.state[LOG_FOCAL] - log_focal) > RIVAL]
    if rivals or std > MAX_FOCAL_STD:
        return None, None, (f'focal length has a relative deviation of {std:.3f}, must be at most '
                            f'{MAX_FOCAL_STD}, and {len(rivals)} rivals, must have none')
    focal = math.exp(log_focal) * unit
    return focal, std * focal, ''


def log_focal_std(solution: Solution, fit: Fit) -> float:
    """Return the standard deviation of ln f, including the errors that arcs have in common."""
    shared = solution.scale ** 2 * math.hypot(SHARED_FOCAL, SHARED_FOCAL_LENS * curved(fit))
    return math.hypot(math.sqrt(fit.covariance[3, 3]), shared)


def _up_std(up: np.ndarray, fit: Fit, solution: Solution) -> tuple[float | None, str]:
    """Return the deviation of up, radians, on its worse side; or the reason why it has none."""
    x, y, z = up.tolist()
    # Rows: change of up by a rotation about each axis of the optical frame.
    turn = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    variance = np.linalg.eigvalsh(turn.T @ fit.covariance[:3, :3] @ turn)[-1]
    shared = solution.scale ** 2 * math.hypot(SHARED_UP, SHARED_UP_LENS * curved(fit))
    std = math.hypot(math.sqrt(variance), shared, _spread(up, solution))
    if std > MAX_UP_STD:
        return None, (f'up has a deviation of {math.degrees(std):.1f} degrees, must be at most '
                      f'{math.degrees(MAX_UP_STD):.1f}')
    return std, ''


def _spread(up: np.ndarray, solution: Solution) -> float:
    """Return the root mean square angle of rivals to up, radians, by their likelihood."""
    if len(solution.fits) == 1:
        return 0.0
    fits, doubt = solution.fits, CLOSE * len(solution.seen) / DOUBT
    share = np.exp([(fit.posterior - fits[0].posterior) / doubt for fit in fits])
    cosines = np.array([np.abs(axes_of(fit.state) @ up).max() for fit in fits])
    angles = np.arccos(np.minimum(cosines, 1.0))
    share[angles > NEAR_UP] = 0.0
    return math.sqrt(float(share @ angles ** 2 / share.sum()))
