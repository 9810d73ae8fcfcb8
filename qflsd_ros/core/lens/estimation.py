"""
Estimation of a lens from the arcs of its own images, without a calibration.

Equation (4) of the paper holds for the arcs of all straight edges with the same lambda.  The image
of a straight edge that passes the point p (from the distortion centre) with the unit normal n has
the curvature

    k(lambda) = -2 lambda (n p) / (1 - lambda p^2).

The measured curvature of an arc, with its standard deviation, is therefore a measurement of
lambda: precise for long arcs far from the centre, and without information for arcs that pass
through it.  Circles about the centre are excluded: they are more likely the rim of a fisheye's
image circle than edges at infinity.

Some arcs are not images of straight edges, so that the likelihood of an arc is the mixture of
:mod:`lens.straightness`.  The most likely of a few hundred candidates for lambda is refined by
Gauss-Newton steps with the weights of that mixture.

Pixels are assumed to be square, which arcs cannot show.  The distortion centre is assumed to be
the image centre unless it is estimated too; the deviation of lambda grows if arcs contradict that.

Unit of length: half the image's diagonal; origin: the image centre.

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

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.compilation import compiled
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.lens.observation import (
    COLUMNS, CURVATURE, informative, NOISE, NORMAL, observe, POINT, VARIANCE)
from qflsd_ros.core.lens.straightness import compared, OUTLIER_DENSITY, STUDENT

# All of these are chosen, not tuned, unless stated otherwise.
# Range of lambda: from a fisheye that sees more than 180 degrees to a strong pincushion.
LOWEST, HIGHEST = -8.0, 0.6
# Arcs that must agree, and their share of the informative arcs: two or three arcs agree by chance
# on one unknown, and well below a third of the arcs another group could be as large.
LEAST_ARCS, LEAST_SHARE = 5, 0.3
# Greatest standard deviation of an observable lambda.  By equation (4) it changes the sagitta of
# an edge of the length 1 at the distance .5 from the centre by .6 px in an image of 640 x 480.
MAX_STD = 0.0115
# LENS_ERROR for the comparison of candidates, where it is also their spacing.
COARSE_ERROR = 0.03
# Factor by which the scatter of arcs beyond their own noise counts, since neighbouring arcs share
# the flaws of lens and edges.  Measured on annotated photographs.
COMMON = 6.0
# Prior standard deviation of the distortion centre about the image centre, wide enough for lenses
# that are mounted off centre; and the error of its estimate by the flaws of real lenses, measured
# on annotated photographs.
CENTRE_SPREAD, CENTRE_ERROR = 0.05, 0.02
# Squared Mahalanobis distance from which on a centre differs from the image centre: the 99 %
# quantile of chi^2 with 2 degrees of freedom.
OFF_CENTRE = 9.2
# Gauss-Newton steps; an estimate that leaves ASTRAY times the range of lambda does not return; a
# step below SMALL standard deviations ends the refinement, as it no longer matters.
ITERATIONS, ASTRAY, SMALL = 30, 3.0, 0.02


@dataclass(frozen=True)
class LensEstimate:
    """
    A lens estimated from arcs, with its uncertainty.

    Attributes
    ----------
    model
        The most likely lens.
    covariance
        (3, 3) float64, the covariance of lambda and of the distortion centre's x and y (px); 0 for
        a centre that was assumed, not estimated.
    agreeing
        Number of arcs that agree with the lens.
    share
        Their share of the informative arcs: those that are long enough and far enough from the
        centre to depend on lambda.

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
        """
        Return the standard deviation of the distortion centre, px: the larger one of x and y.

        0 if the centre was assumed.
        """
        return math.sqrt(max(self.covariance[1, 1], self.covariance[2, 2]))


def estimate_distortion(images: Sequence[Arcs], shape: tuple[int, int], *, centre: bool = False,
                        max_std: float = MAX_STD) -> LensEstimate | None:
    """
    Estimate the lens of a camera from the arcs of its images.

    Parameters
    ----------
    images
        The arcs of each image; all images are from the same camera.
    shape
        (height, width) of the images, px.
    centre
        Whether to estimate the distortion centre too.  It stays close to the image centre if the
        arcs contain little information about it.  If False, the image centre is assumed; if the
        arcs contradict that, the log says so and the standard deviation of lambda covers the
        error.
    max_std
        Greatest standard deviation of an observable lambda near 0.  The limit is
        (1 - lambda / 3)^2 times as large elsewhere, where the same change of lambda bends lines
        less.

    Returns
    -------
    estimate
        None if the lens is not observable: there are too few arcs, all arcs are short or pass
        through the centre, or too few of them agree.  The log has the reason.

    """
    seen = np.concatenate([np.empty((0, COLUMNS))] + [observe(arcs, shape) for arcs in images])
    return estimate_from(seen, shape, centre, max_std)


def estimate_from(seen: np.ndarray, shape: tuple[int, int], centre: bool = False,
                  max_std: float = MAX_STD) -> LensEstimate | None:
    """
    Estimate the lens from observations of arcs.

    ``seen`` is the result of :func:`observe`, (N, COLUMNS); all else is as in
    :func:`estimate_distortion`.
    """
    useful = informative(seen)
    if len(useful) < LEAST_ARCS:
        _log_unobservable(f'{len(useful)} of {len(seen)} arcs are long enough and far enough from '
                          f'the centre, must be at least {LEAST_ARCS}')
        return None
    fit = _refine(useful, _best(useful, centre), 3 if centre else 1)
    agreeing = int(np.count_nonzero(fit.straight > 0.5))
    if agreeing < max(LEAST_ARCS, LEAST_SHARE * len(useful)):
        _log_unobservable(f'{agreeing} of {len(useful)} arcs agree at most')
        return None
    lam, covariance = float(fit.lens[0]), fit.covariance
    if not centre:
        covariance[0, 0] += _error_by_centre(useful, fit) ** 2
    std, most = math.sqrt(covariance[0, 0]), max_std * (1 - lam / 3) ** 2
    if not (LOWEST <= lam <= HIGHEST and std <= most):
        _log_unobservable(f'lambda would be {lam:.3f} with a standard deviation of {std:.3f}, '
                          f'must be at most {most:.3f}')
        return None
    model = DivisionModel(lam, shape)
    scale = np.array([1.0, model.half_diagonal, model.half_diagonal])
    if centre:
        model = replace(model, centre=tuple((model.origin + (scale * fit.lens)[1:]).tolist()))
    return LensEstimate(model, covariance * np.outer(scale, scale), agreeing,
                        agreeing / len(useful))


def _error_by_centre(seen: np.ndarray, fit: _Fit) -> float:
    """
    Return the error of lambda if arcs contradict the assumed distortion centre, else 0.

    Arcs contradict it if the most likely centre is farther off than its scatter and CENTRE_ERROR
    explain.  The difference of lambda with the two centres is then about the error.
    """
    free = _refine(seen, fit.lens[0], 3)
    shift = free.lens[1:]
    covariance = free.scatter[1:, 1:] + CENTRE_ERROR ** 2 * np.eye(2)
    if shift @ np.linalg.solve(covariance, shift) < OFF_CENTRE:
        return 0.0
    logging.getLogger(__name__).info(
        'arcs contradict a centre of distortion in the middle of the image: it seems to be off '
        'by (%.2f, %.2f) of half the diagonal and should be estimated too', *shift)
    return free.lens[0] - fit.lens[0]


def warm_up() -> None:
    """Compile the kernels, or load them from the cache, before the first frame comes."""
    seen = observe(Arcs.empty(), (1, 1))
    _best(seen, False)
    compared(seen, np.zeros(3), np.zeros((2, 2)))


def _log_unobservable(reason: str) -> None:
    logging.getLogger(__name__).info('lens not observable: %s', reason)


def _candidates() -> np.ndarray:
    """
    Return candidates for lambda whose spacing is the expected error, COARSE_ERROR.

    The curvature depends on lambda as ``1 / (1 - lambda p^2)^2``, where p^2 is 1 / 3 on average
    over an image; hence the candidates are evenly spaced in ``lambda / (1 - lambda / 3)``.
    """
    low, high = (lam / (1 - lam / 3) for lam in (LOWEST, HIGHEST))
    even = np.arange(low, high, COARSE_ERROR)
    return even / (1 + even / 3)


CANDIDATES = _candidates()


def _best(seen: np.ndarray, centre: bool) -> float:
    """Return the most likely candidate; ``centre`` is whether the centre is estimated too."""
    likelihoods = np.zeros(len(CANDIDATES))
    _vote(seen, CANDIDATES, 2 * CENTRE_SPREAD * centre, likelihoods)
    return CANDIDATES[np.argmax(likelihoods)]


@compiled
def _vote(seen: np.ndarray, candidates: np.ndarray, centre_spread: float,
          likelihoods: np.ndarray) -> None:
    """
    Add up the log likelihood of each candidate, up to a constant.

    Likelihoods are multiplied as long as float64 can hold the product, which saves logarithms.
    """
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


class _Fit(NamedTuple):
    """
    A lens fitted to arcs, in units of half the diagonal.

    Attributes
    ----------
    lens
        (3,) lambda and the distortion centre.
    scatter
        (3, 3) covariance of the lens from the scatter of the arcs alone; 0 for an assumed centre.
    covariance
        (3, 3) the same with the error by which the prior draws the centre to the image centre.
    straight
        (N,) probability of each arc that it is the image of a straight edge.

    """

    lens: np.ndarray
    scatter: np.ndarray
    covariance: np.ndarray
    straight: np.ndarray


def _refine(seen: np.ndarray, start: float, free: int) -> _Fit:
    """
    Return the most likely lens near the lambda ``start``.

    ``free`` is 1 to estimate lambda alone and 3 to estimate the centre too.  The uncertainty of
    the centre is CENTRE_SPREAD at first, and that of the last step afterwards.
    """
    lens = np.array([start, 0.0, 0.0])
    prior = np.diag([0.0, CENTRE_SPREAD ** -2, CENTRE_SPREAD ** -2][:free])
    spread = np.zeros((2, 2))
    if free == 3:
        spread = np.diag([CENTRE_SPREAD ** 2] * 2)
    for _ in range(ITERATIONS):
        found = compared(seen, lens, spread)
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
    Return the covariance of a fit from the scatter of the arcs.

    ``error`` has the residuals with each arc left out of the fit in turn (jackknife), and
    ``influence`` the derivative of the lens by each residual.  The part of the variance beyond
    the arcs' own noise counts COMMON times, as neighbouring arcs share the flaws of lens and
    edges: they err together.
    """
    noise = (influence ** 2 * seen[:, [NOISE]]).sum(axis=0)
    product = (influence.T * error ** 2) @ influence
    scatter = np.diag(product)
    deviations = np.sqrt(noise + COMMON * np.maximum(scatter - noise, 0))
    scale = deviations / np.sqrt(np.maximum(scatter, np.finfo(float).tiny))
    return product * np.outer(scale, scale)
