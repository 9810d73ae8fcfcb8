"""
The lens from the arcs of its own images: lambda without a calibration.

Equation (4) of the paper holds for every arc of an image with the same lambda.  Where an arc
passes the point p (from the centre of distortion) with the unit normal n, the picture of a
straight edge has the curvature

    k(lambda) = -2 lambda (n p) / (1 - lambda p^2)

whatever the edge.  The curvature that is seen, with its standard deviation, is a measurement of
lambda, sharp for long arcs far from the centre, void for those that pass through it.  Circles
about the centre are left out: rather than edges at infinity, they are the rim of a fisheye's
image.  Not all arcs are pictures of straight edges, so that the likelihood is a mixture

    (1 - OUTLIERS) t(k - k(lambda)) + OUTLIERS / (range of curvatures)

with t Student's distribution of 3 degrees of freedom.  The most likely of some hundred lambdas
is refined by Gauss-Newton steps with the weights of that mixture.

Pixels are taken to be square, which arcs do not show, and the centre of distortion to be the
image's own unless it is estimated as well; arcs that contradict that widen the deviation.

Unit of length: half the image's diagonal; origin: the image's centre.

References: F. Bukhari and M. N. Dailey, Automatic radial distortion estimation from a single
image, JMIV 2013; M. Aleman-Flores et al., Automatic lens distortion correction using
one-parameter division models, IPOL 2014.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import logging
import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.arcs import Arcs, TABLE
from qflsd_ros.core.circle import fit, FIT_SIZE, NO_LENS
from qflsd_ros.core.compilation import compiled
from qflsd_ros.core.lens.division import DivisionModel

LOWEST, HIGHEST = -8.0, 0.6     # lambda: a fisheye beyond 180 degrees, a strong pincushion
LEAST_ARCS = 5          # that must agree
LEAST_SHARE = 0.3       # that must agree, of the arcs that say anything
MAX_STD = 0.0115        # of lambda, from which on it is not observable
OUTLIERS = 0.1          # share of arcs that are no pictures of straight edges
OUTLIER_DENSITY = OUTLIERS / (2 * 10 / 3)       # their curvatures: up to 10 / 3 either way
STUDENT = (1 - OUTLIERS) * 2 / (math.pi * math.sqrt(3))     # density of t for 3 degrees, at 0
CORNER = 3              # edge points left out at each end: those of a rounded corner
LEAST_POINTS = 8        # that must remain
STRAY = 0.1             # px, sagitta by which real edges are bent
LENS_ERROR = 0.01       # of lambda, by which real lenses leave the division model here and there
COARSE_ERROR = 0.03     # the same while candidates are compared, from each to the next
TELLING = 1.0           # standard deviation of lambda from which on one arc says nothing
RIM = 0.05              # distance of a circle from the centre, up to which it is a fisheye's rim
# Where arcs scatter more than by their own noise, so many err together (measured on photographs).
COMMON = 6.0
CENTRE_SPREAD = 0.05    # standard deviation of the centre about the image's, before arcs are seen
CENTRE_ERROR = 0.02     # by which flaws of lenses shift the centre that arcs show (photographs)
# Square of the Mahalanobis distance from which on a centre is not the image's: chi^2 of 2 degrees
# of freedom exceeds it once in 100.
OFF_CENTRE = 9.2
ITERATIONS = 30
ASTRAY = 3.0            # times the bounds of lambda, from where steps do not come back
SMALL = 0.02            # step after which no other follows, in standard deviations
# Columns of observations: curvature, its variance by the noise and in all, unit normal, point.
CURVATURE, NOISE, VARIANCE, NORMAL, POINT, COLUMNS = 0, 1, 2, 3, 5, 7

STRAIGHT_TABLE = np.dtype(TABLE.descr + [
    ('straight', np.float64),   # probability that the arc is the picture of a straight edge
])


@dataclass(frozen=True)
class LensEstimate:
    """
    A lens as the arcs tell it.

    Attributes
    ----------
    model
        The most likely lens.
    covariance
        (3, 3) float64 of lambda and of the centre's x and y, px; 0 for a centre that was taken
        for granted.
    agreeing
        Number of arcs that agree with it.
    share
        The same as a share of all arcs that say something about it.

    """

    model: DivisionModel
    covariance: np.ndarray = field(compare=False)
    agreeing: int
    share: float

    @property
    def lam(self) -> float:
        """Lambda, normalised to half the image's diagonal."""
        return self.model.lam

    @property
    def std(self) -> float:
        """Return the standard deviation of lambda."""
        return math.sqrt(self.covariance[0, 0])

    @property
    def centre_std(self) -> float:
        """Return that of the centre, px, the larger of x and y; 0 if taken for granted."""
        return math.sqrt(max(self.covariance[1, 1], self.covariance[2, 2]))


def estimate_distortion(images: Sequence[Arcs], shape: tuple[int, int], *, centre: bool = False,
                        max_std: float = MAX_STD) -> LensEstimate | None:
    """
    Estimate the lens through which images were taken, from their arcs.

    Parameters
    ----------
    images
        The arcs of each image.
    shape
        (height, width) of the images, px.
    centre
        Estimate the centre of distortion as well; it stays close to that of the image where the
        arcs say little about it.  Otherwise it is the image's: where the arcs contradict that,
        the standard deviation of lambda covers the error, and the log says so.
    max_std
        Standard deviation of lambda from which on it is not observable; where that is far from 0,
        (1 - lambda / 3)^2 times as much, as it takes that much to bend pictures alike.

    Returns
    -------
    The lens, or None where it is not observable, with the reason in the log: too few arcs, all
    of them short or through the centre, or no lens that enough of them agree with.

    """
    seen = np.concatenate([np.empty((0, COLUMNS))] + [observe(arcs, shape) for arcs in images])
    return estimate_from(seen, shape, centre, max_std)


def estimate_from(seen: np.ndarray, shape: tuple[int, int], centre: bool = False,
                  max_std: float = MAX_STD) -> LensEstimate | None:
    """Do as :func:`estimate_distortion`, from what :func:`observe` returns."""
    useful = telling(seen)
    if len(useful) < LEAST_ARCS:
        return _not_observable(f'{len(useful)} of {len(seen)} arcs are long enough and far '
                               f'enough from the centre, must be at least {LEAST_ARCS}')
    fit = _refine(useful, _best(useful, centre), 3 if centre else 1)
    agreeing = int(np.count_nonzero(fit.straight > 0.5))
    if agreeing < max(LEAST_ARCS, LEAST_SHARE * len(useful)):
        return _not_observable(f'{agreeing} of {len(useful)} arcs agree at most')
    lam, covariance = float(fit.lens[0]), fit.covariance
    if not centre:
        covariance[0, 0] += _astray(useful, fit) ** 2
    std, most = math.sqrt(covariance[0, 0]), max_std * (1 - lam / 3) ** 2
    if not (LOWEST <= lam <= HIGHEST and std <= most):
        return _not_observable(f'lambda would be {lam:.3f} with a standard deviation of '
                               f'{std:.3f}, must be at most {most:.3f}')
    model = DivisionModel(lam, shape)
    scale = np.array([1.0, model.half_diagonal, model.half_diagonal])
    if centre:
        model = replace(model, centre=tuple((model.origin + (scale * fit.lens)[1:]).tolist()))
    return LensEstimate(model, covariance * np.outer(scale, scale), agreeing,
                        agreeing / len(useful))


def telling(seen: np.ndarray) -> np.ndarray:
    """Return the observations that say something of the lens by themselves, and are no rim."""
    bend, normal, point = seen[:, [CURVATURE]], seen[:, NORMAL:POINT], seen[:, POINT:]
    across = (normal * point).sum(axis=1)
    is_rim = np.hypot(*(bend * point - normal).T) < RIM * np.abs(bend[:, 0])
    return seen[(4 * across ** 2 * TELLING ** 2 > seen[:, VARIANCE]) & ~is_rim]


def _astray(seen: np.ndarray, fit: _Fit) -> float:
    """
    Return by how much lambda is wrong where arcs contradict the centre that it takes for granted.

    The most likely centre is then farther off than its own scatter and CENTRE_ERROR explain, and
    lambda with that centre differs from the one without by about its error.
    """
    free = _refine(seen, fit.lens[0], 3)
    shift = free.lens[1:]
    covariance = free.scatter[1:, 1:] + CENTRE_ERROR ** 2 * np.eye(2)
    if shift @ np.linalg.solve(covariance, shift) < OFF_CENTRE:
        return 0.0
    logging.getLogger(__name__).info(
        'arcs contradict a centre of distortion in the middle of the image: it seems to be off '
        'by (%.2f, %.2f) of half the diagonal and should be estimated, too', *shift)
    return free.lens[0] - fit.lens[0]


def straightness(arcs: Arcs, model: DivisionModel) -> np.ndarray:
    """
    Return for each arc the probability that it is the picture of a straight edge: (M,) float64.

    Near 0 for true circles; nan for arcs of too few edge points to tell.
    """
    seen = observe(arcs, model.shape)
    shift = (model.origin - DivisionModel(0.0, model.shape).origin) / model.half_diagonal
    return _compared(seen, np.array([model.lam, *shift]), np.zeros((2, 2)))[:, 4]


def with_straightness(arcs: Arcs, model: DivisionModel | None) -> Arcs:
    """
    Return the arcs with their :func:`straightness` as a column ``straight`` of the table.

    It is nan where no lens is known.
    """
    table = np.empty(len(arcs), STRAIGHT_TABLE)
    for name in TABLE.names:
        table[name] = arcs.table[name]
    table['straight'] = np.nan if model is None else straightness(arcs, model)
    return replace(arcs, table=table)


def warm_up() -> None:
    """Compile the kernels, or load them from numba's cache, before the first frame comes."""
    seen = observe(Arcs.empty(), (1, 1))
    _best(seen, False)
    _compared(seen, np.zeros(3), np.zeros((2, 2)))


def _not_observable(reason: str) -> None:
    logging.getLogger(__name__).info('lens not observable: %s', reason)


def observe(arcs: Arcs, shape: tuple[int, int]) -> np.ndarray:
    """
    Return what arcs say of the lens: a row for each, nan for one of too few edge points.

    Their curvature is fitted anew: that in the table is 0 where it is not significant, and takes
    in the ends, where corners are rounded.
    """
    seen = np.full((len(arcs), COLUMNS), np.nan)
    _observe(np.ascontiguousarray(arcs.edge_points.T), arcs.offsets, arcs.table['length'],
             DivisionModel(0.0, shape).origin, float(np.hypot(*shape)) / 2,
             np.empty((1, FIT_SIZE)), seen)
    return seen


@compiled
def _observe(points: np.ndarray, offsets: np.ndarray, lengths: np.ndarray, origin: np.ndarray,
             unit: float, fits: np.ndarray, seen: np.ndarray) -> None:
    for i in range(len(seen)):
        first, last = offsets[i] + CORNER, offsets[i + 1] - 1 - CORNER
        if last - first + 1 < LEAST_POINTS or not fit(points, first, last, 0.0, 0.0, np.inf,
                                                      NO_LENS, fits, 0):
            continue
        x, y, A, B, C, D = fits[0, 0], fits[0, 1], fits[0, 2], fits[0, 3], fits[0, 4], fits[0, 5]
        size = math.sqrt(B * B + C * C)
        off = 2 * D / (1 + size)
        seen[i, CURVATURE] = 2 * A * unit
        seen[i, NOISE] = 4 * fits[0, 8] * unit ** 2
        seen[i, VARIANCE] = seen[i, NOISE] + (8 * STRAY * unit / lengths[i] ** 2) ** 2
        seen[i, NORMAL], seen[i, NORMAL + 1] = B / size, C / size
        seen[i, POINT] = (x - off * B / size - origin[0]) / unit
        seen[i, POINT + 1] = (y - off * C / size - origin[1]) / unit


def _candidates() -> np.ndarray:
    """
    Return lambdas so far from each other as the errors to be expected.

    With lambda the change of curvature falls off as ``(1 - lambda p^2)^2``, where p^2 is 1 / 3 on
    average over an image; so ``lambda / (1 - lambda / 3)`` is evenly spaced.
    """
    low, high = (lam / (1 - lam / 3) for lam in (LOWEST, HIGHEST))
    even = np.arange(low, high, COARSE_ERROR)
    return even / (1 + even / 3)


CANDIDATES = _candidates()


def _best(seen: np.ndarray, centre: bool) -> float:
    """Return the most likely of the candidates; ``centre`` tells whether that is open."""
    likelihoods = np.zeros(len(CANDIDATES))
    _vote(seen, CANDIDATES, 2 * CENTRE_SPREAD * centre, likelihoods)
    return CANDIDATES[np.argmax(likelihoods)]


@compiled
def _vote(seen: np.ndarray, candidates: np.ndarray, centre_spread: float,
          likelihoods: np.ndarray) -> None:
    """Add up the logarithm of the likelihood of each candidate, but for a constant."""
    for j in range(len(candidates)):
        lam = candidates[j]
        error = 2 * COARSE_ERROR * (1 - lam / 3) ** 2
        shift = (centre_spread * lam) ** 2
        product = 1.0
        for i in range(len(seen)):
            x, y = seen[i, POINT], seen[i, POINT + 1]
            across = seen[i, NORMAL] * x + seen[i, NORMAL + 1] * y
            part = across / (1 - lam * (x * x + y * y))
            off = seen[i, CURVATURE] + 2 * lam * part
            slope = error * part * part / across
            variance = seen[i, VARIANCE] + slope * slope + shift
            near = 1 + off * off / (3 * variance)
            product *= 1 + STUDENT / OUTLIER_DENSITY / (math.sqrt(variance) * near * near)
            if product > 1e200:
                likelihoods[j] += math.log(product)
                product = 1.0
        likelihoods[j] += math.log(product)


def _compared(seen: np.ndarray, lens: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """
    Compare arcs with a lens: lambda, and the centre, known up to the covariance ``spread``.

    Returns for each arc k - k(lens), the derivative of k(lens) to lambda and centre, the
    probability that it is straight, and its weight in least squares: (N, 6).
    """
    found = np.empty((len(seen), 6))
    _compare(seen, lens, spread, found)
    return found


@compiled
def _compare(seen: np.ndarray, lens: np.ndarray, spread: np.ndarray, found: np.ndarray) -> None:
    lam = lens[0]
    lens_error = (LENS_ERROR * (1 - lam / 3) ** 2) ** 2
    for i in range(len(seen)):
        u, v = seen[i, NORMAL], seen[i, NORMAL + 1]
        x, y = seen[i, POINT] - lens[1], seen[i, POINT + 1] - lens[2]
        fall = 1 - lam * (x * x + y * y)
        part = (u * x + v * y) / fall
        error, slope = seen[i, CURVATURE] + 2 * lam * part, -2 * part / fall
        across = 2 * lam * (u + 2 * lam * part * x) / fall
        along = 2 * lam * (v + 2 * lam * part * y) / fall
        variance = (seen[i, VARIANCE] + slope * slope * lens_error + across * across * spread[0, 0]
                    + 2 * across * along * spread[0, 1] + along * along * spread[1, 1])
        square = error * error / variance
        density = STUDENT / math.sqrt(variance) / (1 + square / 3) ** 2
        straight = density / (density + OUTLIER_DENSITY)
        found[i, 0], found[i, 1], found[i, 2], found[i, 3] = error, slope, across, along
        found[i, 4], found[i, 5] = straight, straight * 4 / (3 + square) / variance


class _Fit(NamedTuple):
    """
    A lens fitted to arcs.

    Lambda and the centre, (3,); their covariance, (3, 3), without and with the error by which
    the centre is drawn to the image's own, 0 where it is; and the probability of each arc to be
    straight, (N,).  In units of half the diagonal.
    """

    lens: np.ndarray
    scatter: np.ndarray
    covariance: np.ndarray
    straight: np.ndarray


def _refine(seen: np.ndarray, start: float, free: int) -> _Fit:
    """
    Return the most likely lens near a lambda.

    Of lambda and the centre's x and y the first ``free`` are looked for.  The centre is as open
    at first as CENTRE_SPREAD says, then as the arcs leave it.
    """
    lens = np.array([start, 0.0, 0.0])
    prior = np.diag([0.0, CENTRE_SPREAD ** -2, CENTRE_SPREAD ** -2][:free])
    spread = np.zeros((2, 2))
    if free == 3:
        spread = np.diag([CENTRE_SPREAD ** 2] * 2)
    for _ in range(ITERATIONS):
        found = _compared(seen, lens, spread)
        error, slopes, weights = found[:, 0], found[:, 1:1 + free], found[:, 5]
        inverse = np.linalg.inv((slopes.T * weights) @ slopes + prior)
        step = inverse @ (slopes.T @ (weights * error) - prior @ lens[:free])
        lens[:free] += step
        spread[:free - 1, :free - 1] = inverse[1:, 1:]
        settled = (np.abs(step) < SMALL * np.sqrt(np.diag(inverse))).all()
        if settled or not ASTRAY * LOWEST < lens[0] < ASTRAY * HIGHEST:
            break
    influence = (slopes * weights[:, None]) @ inverse
    own = (influence * slopes).sum(axis=1)
    pull = inverse @ prior * CENTRE_SPREAD
    scatter, covariance = np.zeros((3, 3)), np.zeros((3, 3))
    scatter[:free, :free] = _scatter(seen, error / (1 - own), influence)
    covariance[:free, :free] = scatter[:free, :free] + pull @ pull.T
    return _Fit(lens, scatter, covariance, found[:, 4])


def _scatter(seen: np.ndarray, error: np.ndarray, influence: np.ndarray) -> np.ndarray:
    """
    Return the covariance of a fit from how the arcs scatter, each left out of it in turn.

    Arcs that lie close to each other show the same flaws of lens and edges: what is more than
    their own noise counts COMMON times, as if so many were one.
    """
    noise = (influence ** 2 * seen[:, [NOISE]]).sum(axis=0)
    product = (influence.T * error ** 2) @ influence
    scatter = np.diag(product)
    deviations = np.sqrt(noise + COMMON * np.maximum(scatter - noise, 0))
    scale = deviations / np.sqrt(np.maximum(scatter, np.finfo(float).tiny))
    return product * np.outer(scale, scale)
