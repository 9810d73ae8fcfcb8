"""
Refinement of three orthogonal directions, focal length and lens on all arcs at once.

Unknowns are a rotation, the logarithm of the focal length f, lambda and mu of the lens, and the
optical centre c in the undistorted image. A direction d has the vanishing point v = K d = (f d_x +
c_x d_z, f d_y + c_y d_z, d_z), and an arc deviates from it by the angle e with sin e = A / S, A =
l v, B = b v, S^2 = A^2 + B^2 (see :mod:`great_circles`), hence

    d sin e = B (B dA - A dB) / S^3.

With N = K' l the derivative of A by a rotation is d x N.  An arc's angle follows the mixture of
Student's distributions of three directions, and of any angle.  Levenberg-Marquardt steps on the
expected weights, with Gaussian priors for all but the rotation.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.attitude.great_circles import (
    bends, DEVIATION, Line, line, NORMAL_X, NORMAL_Y, X, Y)
from qflsd_ros.core.attitude.vanishing import NONE, TOGETHER
from qflsd_ros.core.cholesky import factorise, solve
from qflsd_ros.core.compilation import compiled, inlined, summed

# Degrees of freedom of Student's distribution of an arc's angle, whose tails are heavy; chosen,
# not tuned.
NU = 1.5
# Its density at 0, over that of any angle, 1 / pi, for a deviation of 1.
PEAK = math.pi * math.gamma((NU + 1) / 2) / (math.sqrt(NU * math.pi) * math.gamma(NU / 2))
# The state: the axes (rows of 3 x 3), ln f, lambda, mu, and the optical centre.
LOG_FOCAL, LAMBDA, MU, CENTRE, STATE = 9, 10, 11, 12, 14
UNKNOWNS = 8                # three of a rotation, and the last five of the state
# Damping of the first step, and its factors after a good and a bad step.
DAMPING, EASE, BRAKE = 1e-2, 0.2, 8.0
NEGLIGIBLE = 1e-3           # probability of a direction below which an arc does not count for it
TINY = 1e-12                # below any diagonal element of a Hessian that occurs
# Steps of the scale of deviations, and its limit: what lens and edge points leave at least.
SCALE_STEPS, LEAST_SCALE = 6, 0.1
SETTLED = 3e-3              # gain in log likelihood below which a step is the last one


class Memory(NamedTuple):
    """Working memory of a refinement; n = UNKNOWNS."""

    points: np.ndarray      # (3, 3) vanishing points of the axes
    hessian: np.ndarray     # (n, n), and slope, of the state
    slope: np.ndarray       # (n,)
    tried: np.ndarray       # (n, n), and slope, of the trial
    tried_slope: np.ndarray     # (n,)
    factor: np.ndarray      # (n, n), Cholesky's
    step: np.ndarray        # (n,)
    trial: np.ndarray       # (STATE,)


class Prior(NamedTuple):
    """Gaussian priors of ln f, lambda, mu, and the optical centre x and y."""

    mean: np.ndarray        # (5,)
    precision: np.ndarray   # (5,) inverse variances


class Fit(NamedTuple):
    """
    A local maximum of the likelihood.

    Attributes
    ----------
    state
        (STATE,) axes, ln f in half diagonals, lambda, mu, optical centre in half diagonals.
    hessian
        (UNKNOWNS, UNKNOWNS) of the negative log posterior, by a rotation about x, y, z of the
        optical frame, ln f, lambda, mu and centre.
    posterior
        Logarithm of likelihood and prior, 0 for arcs that point anywhere and the prior's mean.

    """

    state: np.ndarray
    hessian: np.ndarray
    posterior: float

    @property
    def covariance(self) -> np.ndarray:
        """Return the inverse of the Hessian."""
        return np.linalg.inv(self.hessian + TINY * np.eye(UNKNOWNS))


@compiled
def vanish(state: np.ndarray, points: np.ndarray) -> None:
    """Set the vanishing point K d of each axis d, a row each."""
    f = math.exp(state[LOG_FOCAL])
    for k in range(3):
        x, y, z = state[3 * k], state[3 * k + 1], state[3 * k + 2]
        points[k, 0] = f * x + state[CENTRE] * z
        points[k, 1] = f * y + state[CENTRE + 1] * z
        points[k, 2] = z


@inlined
def _seen_by(points: np.ndarray, k: int, at: Line) -> float:
    """Return l v of the vanishing point v of axis k."""
    return at[0] * points[k, 0] + at[1] * points[k, 1] + at[2] * points[k, 2]


@inlined
def density(along: float, across: float, deviation: float) -> float:
    """Return the density of an arc's angle, over that of any angle, for tan e = along / across."""
    square = along * along
    root = math.sqrt(1 + square / ((square + across * across) * NU * deviation * deviation))
    return PEAK / (deviation * root * root * math.sqrt(root))


@inlined
def _densities(points: np.ndarray, a: Line, b: Line, deviation: float
               ) -> tuple[float, float, float]:
    """Return the shares of the three axes in the density of an arc's angle, up to NONE."""
    share = (1 - NONE) / 3
    return (share * density(_seen_by(points, 0, a), _seen_by(points, 0, b), deviation),
            share * density(_seen_by(points, 1, a), _seen_by(points, 1, b), deviation),
            share * density(_seen_by(points, 2, a), _seen_by(points, 2, b), deviation))


@summed
def _accumulate(seen: np.ndarray, state: np.ndarray, points: np.ndarray, hessian: np.ndarray,
                slope: np.ndarray) -> float:
    """Set slope and Hessian of the negative log likelihood, and return the log likelihood."""
    hessian[:], slope[:] = 0.0, 0.0
    vanish(state, points)
    f, lens, total, product = math.exp(state[LOG_FOCAL]), (state[LAMBDA], state[MU]), 0.0, 1.0
    for i in range(len(seen)):
        x, y, u, v = seen[i, X], seen[i, Y], seen[i, NORMAL_X], seen[i, NORMAL_Y]
        deviation = seen[i, DEVIATION]
        a, b = line(x, y, u, v, lens), line(x, y, v, -u, lens)
        densities = _densities(points, a, b, deviation)
        mixture = NONE + densities[0] + densities[1] + densities[2]
        product *= mixture
        if i % TOGETHER == TOGETHER - 1:
            total, product = total + math.log(product), 1.0
        bend_a, bend_b = bends(x, y, u, v), bends(x, y, v, -u)
        for k in range(3):
            share = densities[k] / mixture
            if share < NEGLIGIBLE:
                continue
            along, beside = _seen_by(points, k, a), _seen_by(points, k, b)
            square = along * along + beside * beside
            p, q = beside / square, -along / square
            weight = share * (NU + 1) / (NU * deviation * deviation + along * along / square)
            both = p * a[0] + q * b[0], p * a[1] + q * b[1], p * a[2] + q * b[2]
            bend = (p * bend_a[0] + q * bend_b[0], p * bend_a[1] + q * bend_b[1],
                    p * bend_a[2] + q * bend_b[2], p * bend_a[3] + q * bend_b[3])
            j = _derivatives(state, points, k, f, both, bend)
            _add(hessian, slope, j, weight, along * p)
    return total + math.log(product)


@inlined
def _derivatives(state: np.ndarray, points: np.ndarray, k: int, f: float, both: Line,
                 bend: tuple[float, ...]) -> tuple[float, ...]:
    """Return the derivatives of ``both`` v by all unknowns; ``bend`` is its own by lambda."""
    x, y, z = state[3 * k], state[3 * k + 1], state[3 * k + 2]
    nx, ny = f * both[0], f * both[1]
    nz = state[CENTRE] * both[0] + state[CENTRE + 1] * both[1] + both[2]
    return (y * nz - z * ny, z * nx - x * nz, x * ny - y * nx, nx * x + ny * y,
            bend[0] * points[k, 0] + bend[1] * points[k, 1],
            bend[2] * points[k, 0] + bend[3] * points[k, 1], both[0] * z, both[1] * z)


@inlined
def _add(hessian: np.ndarray, slope: np.ndarray, j: tuple[float, ...], weight: float,
         error: float) -> None:
    """Add an observation with derivatives j to the upper half of the Hessian and to the slope."""
    for r in range(UNKNOWNS):
        slope[r] += weight * error * j[r]
        for c in range(r, UNKNOWNS):
            hessian[r, c] += weight * j[r] * j[c]


@compiled
def _evaluate(seen: np.ndarray, state: np.ndarray, prior: Prior, memory: Memory) -> float:
    """Set slope and Hessian of the negative log posterior, and return the log posterior."""
    total = _accumulate(seen, state, memory.points, memory.tried, memory.tried_slope)
    for k in range(UNKNOWNS - 3):
        off = state[LOG_FOCAL + k] - prior.mean[k]
        memory.tried_slope[3 + k] += prior.precision[k] * off
        memory.tried[3 + k, 3 + k] += prior.precision[k]
        total -= prior.precision[k] * off * off / 2
    return total


@compiled
def _keep(memory: Memory) -> None:
    """Take over slope and Hessian of the trial."""
    for r in range(UNKNOWNS):
        memory.slope[r] = memory.tried_slope[r]
        for c in range(r, UNKNOWNS):
            memory.hessian[r, c] = memory.hessian[c, r] = memory.tried[r, c]


@compiled
def _solve(memory: Memory, damping: float) -> None:
    """Set step to -(H + damping diag H)^-1 slope."""
    for r in range(UNKNOWNS):
        memory.step[r] = -memory.slope[r]
        for c in range(r):
            memory.factor[r, c] = memory.hessian[r, c]
        memory.factor[r, r] = memory.hessian[r, r] * (1 + damping) + TINY
    factorise(memory.factor, UNKNOWNS)      # definite, as the damping is
    solve(memory.factor, memory.step, UNKNOWNS)


@compiled
def _move(state: np.ndarray, step: np.ndarray, moved: np.ndarray) -> None:
    """Set ``moved`` to the state after a step: the axes turned by Rodrigues's formula."""
    wx, wy, wz = step[0], step[1], step[2]
    angle = math.sqrt(wx * wx + wy * wy + wz * wz)
    if angle > 0:
        wx, wy, wz = wx / angle, wy / angle, wz / angle
    c, s = math.cos(angle), math.sin(angle)
    for k in range(3):
        x, y, z = state[3 * k], state[3 * k + 1], state[3 * k + 2]
        along = (1 - c) * (wx * x + wy * y + wz * z)
        moved[3 * k] = c * x + s * (wy * z - wz * y) + along * wx
        moved[3 * k + 1] = c * y + s * (wz * x - wx * z) + along * wy
        moved[3 * k + 2] = c * z + s * (wx * y - wy * x) + along * wz
    for k in range(3, UNKNOWNS):
        moved[6 + k] = state[6 + k] + step[k]


@compiled
def _climb(seen: np.ndarray, state: np.ndarray, prior: Prior, steps: int, memory: Memory) -> float:
    """Move the state to the maximum of the posterior, the logarithm of which is returned."""
    value, damping = _evaluate(seen, state, prior, memory), DAMPING
    _keep(memory)
    for _ in range(steps):
        _solve(memory, damping)
        _move(state, memory.step, memory.trial)
        tried = _evaluate(seen, memory.trial, prior, memory)
        if tried < value:
            damping *= BRAKE
            continue
        gained, value = tried - value, tried
        damping *= EASE
        _keep(memory)
        for k in range(STATE):
            state[k] = memory.trial[k]
        if gained < SETTLED:
            break
    return value


def refine(seen: np.ndarray, start: np.ndarray, prior: Prior, steps: int) -> Fit:
    """
    Return the local maximum of the posterior near a start.

    Parameters
    ----------
    seen
        (N, COLUMNS) observations.
    start
        (STATE,) float64, the state to begin with.
    prior
        Prior of all unknowns but the axes.
    steps
        Largest number of steps, rejected ones included.

    """
    n, state = UNKNOWNS, start.copy()
    memory = Memory(np.zeros((3, 3)), np.zeros((n, n)), np.zeros(n), np.zeros((n, n)), np.zeros(n),
                    np.zeros((n, n)), np.zeros(n), np.zeros(STATE))
    value = _climb(seen, state, prior, steps, memory)
    return Fit(state, memory.hessian, value)


@summed
def _scale(seen: np.ndarray, state: np.ndarray, points: np.ndarray, scale: float) -> float:
    """Return the next estimate of :func:`scale` from the last one."""
    vanish(state, points)
    squares, count, lens = 0.0, 0.0, (state[LAMBDA], state[MU])
    for i in range(len(seen)):
        x, y, u, v = seen[i, X], seen[i, Y], seen[i, NORMAL_X], seen[i, NORMAL_Y]
        deviation = seen[i, DEVIATION] * scale
        a, b = line(x, y, u, v, lens), line(x, y, v, -u, lens)
        densities = _densities(points, a, b, deviation)
        mixture = NONE + densities[0] + densities[1] + densities[2]
        for k in range(3):
            along, beside = _seen_by(points, k, a), _seen_by(points, k, b)
            square = along * along / (along * along + beside * beside) / deviation ** 2
            squares += densities[k] / mixture * (NU + 1) * square / (NU + square)
            count += densities[k] / mixture
    return scale * math.sqrt(squares / count) if count > 0 else scale


def scale(seen: np.ndarray, fit: Fit) -> float:
    """
    Return the factor by which the deviations of the observations fit their residuals.

    It is the most likely one, by a few steps of expectation maximisation.
    """
    value, points = 1.0, np.empty((3, 3))
    for _ in range(SCALE_STEPS):
        value = _scale(seen, fit.state, points, value)
    return min(max(value, LEAST_SCALE), 1.0 / LEAST_SCALE)
