"""
The motion of the image between two frames, as a polynomial of the place.

A camera that turns moves the image by a homography, through a lens by more than that; a cubic
polynomial in x and y follows both to a fraction of a pixel over an image.  An edge at the distance
d along the normal n of a track is one equation for it: n.u(x) = d (normal flow).  They are solved
by least squares with Tukey's weights, beginning with the affine part, and with the motion of the
frame before as a prior.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.tracking.looks import nearest, NX, NY, WAS_X, WAS_Y, X, Y

TERMS = 10              # of a cubic polynomial in x and y
AFFINE, CUBIC = 6, 2 * TERMS
# Least squares in turn: unknowns, and px from which on an edge has no weight.
STEPS = ((AFFINE, 7.0), (AFFINE, 4.0), (CUBIC, 3.0), (CUBIC, 1.5))
# px by which each degree changes from frame to frame, at the border of the image: large enough for
# a camera in a hand, small enough where few tracks are seen.
CHANGES = (10.0, 5.0, 3.0, 0.5)
AGREES = 1.5            # px


@inlined
def _terms(x: float, y: float, phi: np.ndarray) -> None:
    """Write the terms of the polynomial by degree."""
    phi[0], phi[1], phi[2] = 1.0, x, y
    phi[3], phi[4], phi[5] = x * x, x * y, y * y
    phi[6], phi[7], phi[8], phi[9] = x * x * x, x * x * y, x * y * y, y * y * y


@compiled
def scaled(x: float, y: float, width: int, height: int) -> tuple[float, float]:
    """Return a place from the centre of the image, in half diagonals; never beyond its border."""
    size = 0.5 * math.hypot(width, height)
    x, y = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
    return (x - 0.5 * (width - 1)) / size, (y - 0.5 * (height - 1)) / size


@inlined
def _at(field: np.ndarray, phi: np.ndarray) -> tuple[float, float]:
    """Return the motion where the terms are taken, px."""
    u = v = 0.0
    for k in range(TERMS):
        u += field[2 * k] * phi[k]
        v += field[2 * k + 1] * phi[k]
    return u, v


@compiled
def motion(field: np.ndarray, x: float, y: float, width: int, height: int,
           phi: np.ndarray) -> tuple[float, float]:
    """Return the motion at a place, px."""
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
    """Improve the field once; return how many normals agree with it."""
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
    Estimate the motion from the edges on normals.

    Parameters
    ----------
    looks, found, counts, n
        As of :func:`looks.look`.
    shape
        Height and width of the image, px.
    prior, field
        (2 TERMS,) float64: what is expected, and what takes the result: x and y of each term.
    a, b, phi
        (2 TERMS, 2 TERMS), (2 TERMS,) and (TERMS,) float64, scratch.

    Returns
    -------
    The share of the normals with an edge within AGREES of the motion before the last step.

    """
    agreeing = 0
    for i in range(len(field)):
        field[i] = prior[i]
    for unknowns, gate in STEPS:
        agreeing = _step(looks, found, counts, n, shape, prior, field, unknowns, gate, a, b,
                         phi)
    return agreeing / max(n, 1)
