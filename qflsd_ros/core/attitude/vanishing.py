"""
Vanishing points from the lines of arcs, and hypotheses for three orthogonal directions.

Two lines meet in u = l1 x l2 for any focal length, so that points can be searched for before it
is known.  Each arc points to one of the points found so far, or to none of them.  The search takes
the point that adds most to the likelihood of this mixture, refines it, and goes on among the arcs
that are still unexplained.  Likelihoods are relative to a random direction, and each arc counts
once, whatever its length.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.attitude.great_circles import (
    ACROSS, ALONG, PRECISION, SHARPNESS)
from qflsd_ros.core.compilation import compiled, inlined, summed

# Most points that are looked for: three axes, three more directions, and clutter.
POINTS = 10
# The longest unexplained arcs, of which each pair is a candidate.
PAIRED = 36
# Likelihood ratio from which on an arc counts as explained: more likely than not.
EXPLAINED = 1.0
# Gain in log likelihood that a point needs: below it, random arcs give as much.
LEAST_GAIN = 4.0
# Gauss-Newton steps of a point.
STEPS = 3
# Focal lengths in half diagonals of the grid of hypotheses, from a fisheye to a telephoto lens;
# the ratio of neighbours, .17, changes angles between directions by less than TURN.
FOCALS = np.geomspace(0.3, 8.0, 20)
# Cosine of the angle that two points of a hypothesis may have at most.
TURN = math.sin(math.radians(9.0))
# Share of the arcs that point in none of three directions.
NONE = 0.3
# Most further horizontal directions, and the gain in log likelihood that each needs.
FURTHER, FURTHER_GAIN = 3, 8.0
# Products of likelihood ratios, up to 115 each, that float64 can hold before a logarithm.
TOGETHER = 96


@inlined
def ratio(along: float, across: float, sharpness: float, precision: float) -> float:
    """
    Return the density of an arc's angle, over that of any angle, for tan e = along / across.

    Cauchy's distribution stands for Student's with 1.5 degrees of freedom: it needs no root.
    """
    square = across * across + along * along
    return sharpness * square / (square + along * along * precision)


@summed
def gain(rows: np.ndarray, known: np.ndarray, u: np.ndarray) -> float:
    """Return how much the point u adds to the log likelihood, where ``known`` is the mixture."""
    total, x, y, z = 0.0, u[0], u[1], u[2]
    for first in range(0, len(known), TOGETHER):
        product = 1.0
        for i in range(first, min(first + TOGETHER, len(known))):
            along = rows[0, i] * x + rows[1, i] * y + rows[2, i] * z
            across = rows[3, i] * x + rows[4, i] * y + rows[5, i] * z
            product *= 1 + ratio(along, across, rows[6, i], rows[7, i]) * known[i]
        total += math.log(product)
    return total


@inlined
def meet(rows: np.ndarray, i: int, j: int, u: np.ndarray) -> None:
    """Set u to the unit vector of the point where lines i and j meet; 0 if they are the same."""
    u[0] = rows[1, i] * rows[2, j] - rows[2, i] * rows[1, j]
    u[1] = rows[2, i] * rows[0, j] - rows[0, i] * rows[2, j]
    u[2] = rows[0, i] * rows[1, j] - rows[1, i] * rows[0, j]
    size = math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    for k in range(3):
        u[k] = u[k] / size if size > 1e-9 else 0.0


@compiled
def _gains(rows: np.ndarray, known: np.ndarray, points: np.ndarray, gains: np.ndarray) -> None:
    """Set the gain of each point."""
    for k in range(len(points)):
        gains[k] = gain(rows, known, points[k])


@compiled
def _best_pair(rows: np.ndarray, known: np.ndarray, chosen: np.ndarray, u: np.ndarray,
               best: np.ndarray) -> float:
    """Set ``best`` to the intersection with the greatest gain, which is returned."""
    count, most = 0, 0.0
    for i in range(len(known)):
        if known[i] >= EXPLAINED / 2 and count < len(chosen):
            chosen[count] = i
            count += 1
    for i in range(count):
        for j in range(i):
            meet(rows, chosen[i], chosen[j], u)
            value = gain(rows, known, u)
            if value > most:
                most = value
                for k in range(3):
                    best[k] = u[k]
    return most


@compiled
def _polish(rows: np.ndarray, known: np.ndarray, u: np.ndarray) -> None:
    """Move a point to the maximum of its gain: weighted Gauss-Newton steps in two directions."""
    for _ in range(STEPS):
        # Two directions at right angles to u: p = (axis of the smallest part) x u, and u x p.
        k = 0
        for m in range(1, 3):
            if abs(u[m]) < abs(u[k]):
                k = m
        m, n = (k + 1) % 3, (k + 2) % 3
        size = math.sqrt(u[m] * u[m] + u[n] * u[n])
        pm, pn = -u[n] / size, u[m] / size
        qk, qm, qn = -size, u[k] * u[m] / size, u[k] * u[n] / size
        a = b = c = d = e = 0.0
        for i in range(len(known)):
            along = rows[0, i] * u[0] + rows[1, i] * u[1] + rows[2, i] * u[2]
            across = rows[3, i] * u[0] + rows[4, i] * u[1] + rows[5, i] * u[2]
            square = along * along + across * across
            r = ratio(along, across, rows[6, i], rows[7, i]) * known[i]
            weight = r / (1 + r) / (1 / rows[7, i] + along * along / square)
            ap = rows[m, i] * pm + rows[n, i] * pn
            aq = rows[k, i] * qk + rows[m, i] * qm + rows[n, i] * qn
            bp = rows[3 + m, i] * pm + rows[3 + n, i] * pn
            bq = rows[3 + k, i] * qk + rows[3 + m, i] * qm + rows[3 + n, i] * qn
            p, q = (across * ap - along * bp) / square, (across * aq - along * bq) / square
            error = along * across / square
            a += weight * p * p
            b += weight * p * q
            c += weight * q * q
            d += weight * p * error
            e += weight * q * error
        det = a * c - b * b
        if det <= 1e-12 * a * c:
            return
        s, t = -(c * d - b * e) / det, -(a * e - b * d) / det
        long = math.sqrt(s * s + t * t)
        if long > 0.2:
            s, t = s * 0.2 / long, t * 0.2 / long
        u[k] += t * qk
        u[m] += s * pm + t * qm
        u[n] += s * pn + t * qn
        size = math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
        for j in range(3):
            u[j] /= size


@compiled
def _find(rows: np.ndarray, known: np.ndarray, chosen: np.ndarray, points: np.ndarray,
          gains: np.ndarray) -> int:
    """Fill in points, the strongest first, and return how many there are."""
    for k in range(len(points) - 1):
        u = points[k]
        if _best_pair(rows, known, chosen, points[k + 1], u) < LEAST_GAIN:
            return k
        _polish(rows, known, u)
        gains[k] = gain(rows, known, u)
        for i in range(len(known)):
            along = rows[0, i] * u[0] + rows[1, i] * u[1] + rows[2, i] * u[2]
            across = rows[3, i] * u[0] + rows[4, i] * u[1] + rows[5, i] * u[2]
            known[i] = 1 / (1 / known[i] + ratio(along, across, rows[6, i], rows[7, i]))
    return len(points) - 1


def vanishing_points(rows: np.ndarray) -> np.ndarray:
    """
    Return the vanishing points of lines, those that explain most first.

    Parameters
    ----------
    rows
        (ROWS, N), the lines as :func:`great_circles.lines` returns them.

    Returns
    -------
    points
        (K, 3) float64 unit vectors, K <= POINTS: homogeneous coordinates in the undistorted image.

    """
    points, known = np.zeros((POINTS + 1, 3)), np.ones(rows.shape[1])
    count = _find(rows, known, np.empty(PAIRED, np.int64), points, np.empty(POINTS))
    return points[:count]


@summed
def _score(rows: np.ndarray, axes: np.ndarray, focal: float, none: float) -> float:
    """Return the log likelihood of three directions (rows of ``axes``) for a focal length."""
    total, share = 0.0, (1 - none) / 3
    for first in range(0, rows.shape[1], TOGETHER):
        product = 1.0
        for i in range(first, min(first + TOGETHER, rows.shape[1])):
            r = 0.0
            for k in range(3):
                x, y, z = focal * axes[k, 0], focal * axes[k, 1], axes[k, 2]
                along = rows[0, i] * x + rows[1, i] * y + rows[2, i] * z
                across = rows[3, i] * x + rows[4, i] * y + rows[5, i] * z
                r += ratio(along, across, rows[6, i], rows[7, i])
            product *= none + share * r
        total += math.log(product)
    return total


@compiled
def _frame(points: np.ndarray, i: int, j: int, focal: float, axes: np.ndarray) -> bool:
    """
    Set axes to the directions of points i and j, made orthogonal, and their cross product.

    Returns whether they are orthogonal to within TURN.
    """
    for k, n in ((0, i), (1, j)):
        x, y, z = points[n, 0] / focal, points[n, 1] / focal, points[n, 2]
        size = math.sqrt(x * x + y * y + z * z)
        axes[k, 0], axes[k, 1], axes[k, 2] = x / size, y / size, z / size
    dot = axes[0, 0] * axes[1, 0] + axes[0, 1] * axes[1, 1] + axes[0, 2] * axes[1, 2]
    if abs(dot) > TURN:
        return False
    size = math.sqrt(1 - dot * dot)
    for k in range(3):
        axes[1, k] = (axes[1, k] - dot * axes[0, k]) / size
    axes[2, 0] = axes[0, 1] * axes[1, 2] - axes[0, 2] * axes[1, 1]
    axes[2, 1] = axes[0, 2] * axes[1, 0] - axes[0, 0] * axes[1, 2]
    axes[2, 2] = axes[0, 0] * axes[1, 1] - axes[0, 1] * axes[1, 0]
    return True


@compiled
def _propose(rows: np.ndarray, points: np.ndarray, focals: np.ndarray, none: float,
             axes: np.ndarray, best: np.ndarray) -> None:
    """Fill in the best axes of each focal length, and their log likelihood."""
    for n in range(len(focals)):
        best[n, 9] = -np.inf
        for i in range(len(points)):
            for j in range(i + 1, len(points)):
                if not _frame(points, i, j, focals[n], axes):
                    continue
                value = _score(rows, axes, focals[n], none)
                if value > best[n, 9]:
                    for k in range(3):
                        for m in range(3):
                            best[n, 3 * k + m] = axes[k, m]
                    best[n, 9] = value


def frames(rows: np.ndarray, points: np.ndarray, focals: np.ndarray, none: float
           ) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the most likely orthogonal axes for each of several focal lengths.

    Parameters
    ----------
    rows
        (ROWS, N) lines.
    points
        (K, 3) vanishing points.
    focals
        (F,) half diagonals.
    none
        Probability that an arc points in none of three directions.

    Returns
    -------
    axes
        (F, 3, 3) float64, a unit vector in each row, right-handed.
    likelihood
        (F,) the logarithm, 0 for arcs that point anywhere; -inf where no two points are
        orthogonal.

    """
    best = np.empty((len(focals), 10))
    _propose(rows, points, focals, none, np.empty((3, 3)), best)
    return best[:, :9].reshape(-1, 3, 3), best[:, 9]


def shares(rows: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the probability of each point that a line points there: (K, N) for (K, 3) points."""
    along, across = points @ rows[ALONG:ACROSS], points @ rows[ACROSS:SHARPNESS]
    square = along ** 2 + across ** 2
    density = rows[SHARPNESS] * square / (square + along ** 2 * rows[PRECISION])
    density *= (1 - NONE) / len(points)
    return density / (NONE + density.sum(axis=0))


def horizontal(rows: np.ndarray, axes: np.ndarray, camera: np.ndarray,
               known: np.ndarray | None = None) -> np.ndarray:
    """
    Return further directions at right angles to the first axis.

    Parameters
    ----------
    rows
        (ROWS, N) lines.
    axes
        (3, 3) orthogonal directions.
    camera
        (3, 3) from a direction to its vanishing point.
    known
        (J, 3) unit vectors that have been found before.  They stay first, without those that
        explain few arcs by now.

    Returns
    -------
    directions
        (K, 3) unit vectors, K <= FURTHER, those that explain most first.

    """
    found = np.empty((0, 3))
    for direction in () if known is None else known:
        none = _unexplained(rows, np.concatenate([axes, found]) @ camera.T)
        if _gains_of(rows, none, direction[None], camera)[0] > FURTHER_GAIN / 2:
            found = np.concatenate([found, direction[None]])
    normals = camera.T @ rows[ALONG:ACROSS]
    while len(found) < FURTHER:
        none = _unexplained(rows, np.concatenate([axes, found]) @ camera.T)
        left = np.flatnonzero(none > 0.5)[:PAIRED]
        candidates = np.cross(axes[0], normals[:, left].T)
        size = np.linalg.norm(candidates, axis=1, keepdims=True)
        candidates = (candidates / np.maximum(size, 1e-9))[size[:, 0] > 0.1]
        if not len(candidates):
            break
        gains = _gains_of(rows, none, candidates, camera)
        if gains.max() < FURTHER_GAIN:
            break
        found = np.concatenate([found, candidates[[np.argmax(gains)]]])
    return found


def _unexplained(rows: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the probability of each line that it points to none of some points."""
    return 1 - shares(rows, points).sum(axis=0)


def _gains_of(rows: np.ndarray, none: np.ndarray, directions: np.ndarray, camera: np.ndarray
              ) -> np.ndarray:
    """Return how much each direction adds to the log likelihood, beside an axis more."""
    gains = np.empty(len(directions))
    _gains(rows, none / 3, directions @ camera.T, gains)
    return gains
