"""
The motion field between two frames, as a cubic polynomial in the image coordinates.

A camera that turns moves the image by a homography, through a lens by more than that; a cubic
polynomial in x and y approximates both to a fraction of a pixel.  An edge at the distance d along
the normal n of a track gives one equation, n.u(x) = d (normal flow).  The equations are solved by
least squares with Tukey's weights, first for the affine part and then for all terms.  The expected
motion is the prior.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.tracking.looks import nearest, NX, NY, WAS_X, WAS_Y, X, Y

TERMS = 10              # of a cubic polynomial in x and y
AFFINE, CUBIC = 6, 2 * TERMS
# Iterations: unknowns, and px from which on an edge has no weight; chosen, not tuned.
STEPS = ((AFFINE, 7.0), (AFFINE, 4.0), (CUBIC, 3.0), (CUBIC, 1.5))
# Prior standard deviation of the change from frame to frame of the terms of degree 0 to 3, px at
# the border of the image: large enough for a hand-held camera, small enough to stabilise the field
# where there are few tracks; chosen, not tuned.
CHANGES = (10.0, 5.0, 3.0, 0.5)
AGREES = 1.5            # px between an edge and the motion that agree; chosen, not tuned


@inlined
def _terms(x: float, y: float, phi: np.ndarray) -> None:
    """Write the terms of the polynomial by degree."""
    phi[0], phi[1], phi[2] = 1.0, x, y
    phi[3], phi[4], phi[5] = x * x, x * y, y * y
    phi[6], phi[7], phi[8], phi[9] = x * x * x, x * x * y, x * y * y, y * y * y


@compiled
def scaled(x: float, y: float, width: int, height: int) -> tuple[float, float]:
    """Return x, y from the image centre, in half diagonals; clamped to the border of the image."""
    size = 0.5 * math.hypot(width, height)
    x, y = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
    return (x - 0.5 * (width - 1)) / size, (y - 0.5 * (height - 1)) / size


@inlined
def _at(field: np.ndarray, phi: np.ndarray) -> tuple[float, float]:
    """Return the motion u, v, px, by the terms of a place."""
    u = v = 0.0
    for k in range(TERMS):
        u += field[2 * k] * phi[k]
        v += field[2 * k + 1] * phi[k]
    return u, v


@compiled
def motion(field: np.ndarray, x: float, y: float, width: int, height: int,
           phi: np.ndarray) -> tuple[float, float]:
    """Return the motion u, v of the image, px, at the place (x, y), px; ``phi`` is scratch."""
    x, y = scaled(x, y, width, height)
    _terms(x, y, phi)
    return _at(field, phi)


@compiled
def _solve(a: np.ndarray, b: np.ndarray, n: int) -> None:
    """Solve the first n of a x = b by Cholesky; ``a`` is positive definite, ``b`` becomes x."""
    for i in range(n):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            if i == j:
                a[i, i] = math.sqrt(max(total, 1e-12))
            else:
                a[i, j] = total / a[j, j]
    for i in range(n):
        for k in range(i):
            b[i] -= a[i, k] * b[k]
        b[i] /= a[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= a[k, i] * b[k]
        b[i] /= a[i, i]


@inlined
def _degree(unknown: int) -> int:
    """Return the degree of the term that an unknown belongs to."""
    term = unknown // 2
    return 0 if term < 1 else 1 if term < 3 else 2 if term < 6 else 3


@compiled
def _step(looks: np.ndarray, found: np.ndarray, counts: np.ndarray, n: int,
          shape: tuple[int, int], prior: np.ndarray, field: np.ndarray, unknowns: int,
          gate: float, a: np.ndarray, b: np.ndarray, phi: np.ndarray) -> int:
    """Update the field by one iteration; return how many normals agreed with it before."""
    agreeing = 0
    a[:], b[:] = 0.0, 0.0
    for k in range(n):
        x, y = scaled(looks[k, WAS_X], looks[k, WAS_Y], shape[1], shape[0])
        _terms(x, y, phi)
        u, v = _at(field, phi)
        nx, ny = looks[k, NX], looks[k, NY]
        expected = (looks[k, WAS_X] + u - looks[k, X]) * nx + (
            looks[k, WAS_Y] + v - looks[k, Y]) * ny
        r = nearest(found[k], counts[k], expected) - expected
        agreeing += abs(r) < AGREES
        if not abs(r) < gate:
            continue
        w = (1 - (r / gate) ** 2) ** 2
        for i in range(unknowns):
            p = w * phi[i // 2] * (ny if i % 2 else nx)
            b[i] += p * r
            for j in range(i + 1):
                a[i, j] += p * phi[j // 2] * (ny if j % 2 else nx)
    for i in range(unknowns):
        certain = 1 / CHANGES[_degree(i)] ** 2
        a[i, i] += certain
        b[i] += certain * (prior[i] - field[i])
    _solve(a, b, unknowns)
    for i in range(unknowns):
        field[i] += b[i]
    return agreeing


@compiled
def estimate(looks: np.ndarray, found: np.ndarray, counts: np.ndarray, n: int,
             shape: tuple[int, int], prior: np.ndarray, field: np.ndarray, a: np.ndarray,
             b: np.ndarray, phi: np.ndarray) -> float:
    """
    Estimate the motion field from the edges on normals.

    Parameters
    ----------
    looks, found, counts, n
        As of :func:`looks.look`.
    shape
        Height and width of the image, px.
    prior, field
        (2 TERMS,) float64: the expected field, and the one that receives the result, x and y of
        each term in turn.
    a, b, phi
        (2 TERMS, 2 TERMS), (2 TERMS,) and (TERMS,) float64, scratch.

    Returns
    -------
    Share of the normals with an edge within AGREES px of the motion before the last iteration.

    """
    agreeing = 0
    for i in range(len(field)):
        field[i] = prior[i]
    for unknowns, gate in STEPS:
        agreeing = _step(looks, found, counts, n, shape, prior, field, unknowns, gate, a, b,
                         phi)
    return agreeing / max(n, 1)
