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
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.cholesky import factorise, solve
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.tracking.motion.looks import Looks, nearest, NX, NY, WAS_X, WAS_Y, X, Y

TERMS = 10              # of a cubic polynomial in x and y
AFFINE, CUBIC = 6, 2 * TERMS    # unknowns of an affine and of a cubic motion
# Iterations: unknowns, and px from which on an edge has no weight; chosen, not tuned.
STEPS = ((AFFINE, 7.0), (AFFINE, 4.0), (CUBIC, 3.0), (CUBIC, 1.5))
# Prior standard deviation of the change from frame to frame of the terms of degree 0 to 3, px at
# the border of the image: large enough for a hand-held camera, small enough to stabilise the field
# where there are few tracks; chosen, not tuned.
CHANGES = (10.0, 5.0, 3.0, 0.5)
AGREES = 1.5            # px between an edge and the motion that agree; chosen, not tuned


# Exponents of x and y of the terms, by degree.
POWERS = tuple((degree - j, j) for degree in range(4) for j in range(degree + 1))
MOMENTS = 28            # terms of a polynomial of degree 6: all products of two terms


def _index_of(i: int, j: int) -> int:
    """Return the number of the term x^i y^j."""
    return (i + j) * (i + j + 1) // 2 + j


# Number of the product of two terms.
PRODUCTS = np.array([[_index_of(i + k, j + m) for k, m in POWERS] for i, j in POWERS])


class Extent(NamedTuple):
    """Size of an image."""

    width: float            # px
    height: float
    half_diagonal: float


@inlined
def extent(height: int, width: int) -> Extent:
    """Return the size of an image of (height, width) px."""
    return Extent(float(width), float(height), 0.5 * math.hypot(width, height))


@inlined
def scaled(x: float, y: float, size: Extent) -> tuple[float, float]:
    """Return x, y from the image centre, in half diagonals; clamped to the border of the image."""
    x, y = min(max(x, 0.0), size.width - 1), min(max(y, 0.0), size.height - 1)
    scale = 1 / size.half_diagonal
    return (x - 0.5 * (size.width - 1)) * scale, (y - 0.5 * (size.height - 1)) * scale


@inlined
def _cubic(f: np.ndarray, k: int, x: float, y: float) -> float:
    """Return the value of the polynomial with the coefficients f[k], f[k + 2] and so on."""
    return (f[k] + x * (f[k + 2] + x * (f[k + 6] + x * f[k + 12]))
            + y * (f[k + 4] + x * (f[k + 8] + x * f[k + 14])
                   + y * (f[k + 10] + x * f[k + 16] + y * f[k + 18])))


@inlined
def motion(field: np.ndarray, x: float, y: float, size: Extent) -> tuple[float, float]:
    """Return the motion u, v of the image, px, at the place (x, y), px."""
    x, y = scaled(x, y, size)
    return _cubic(field, 0, x, y), _cubic(field, 1, x, y)


@inlined
def _degree(unknown: int) -> int:
    """Return the degree of the term that an unknown belongs to."""
    term = unknown // 2
    return 0 if term < 1 else 1 if term < 3 else 2 if term < 6 else 3


class Memory(NamedTuple):
    """Arrays that the estimation of a field works on; terms are x and y of each in turn."""

    prior: np.ndarray       # (CUBIC,) float64, the expected field
    field: np.ndarray       # (CUBIC,) float64, receives the estimated one
    a: np.ndarray           # (CUBIC, CUBIC) float64 and (CUBIC,): the normal equations
    b: np.ndarray
    phi: np.ndarray         # (MOMENTS,) float64, the terms of a place and their products
    # (3, MOMENTS) float64: sums of these, times the products xx, xy and yy of the normals.
    moments: np.ndarray


def memory() -> Memory:
    """Return memory with a prior at rest."""
    return Memory(np.zeros(CUBIC), np.zeros(CUBIC), np.empty((CUBIC, CUBIC)), np.empty(CUBIC),
                  np.empty(MOMENTS), np.empty((3, MOMENTS)))


@inlined
def _expand(x: float, y: float, moments: int, phi: np.ndarray) -> None:
    """Write the first ``moments`` terms of the polynomial, by degree."""
    phi[0] = 1.0
    last, at, degree = 0, 1, 1
    while at < moments:
        for j in range(degree):
            phi[at + j] = x * phi[last + j]
        phi[at + degree] = y * phi[last + degree - 1]
        last, at, degree = at, at + degree + 1, degree + 1


@inlined
def _add(memory: Memory, terms: int, moments: int, normal: tuple[float, float], r: float,
         w: float) -> None:
    """Add the equation of a normal with the residual r, px, and the weight w; phi is set."""
    nx, ny = normal
    phi, xx, xy, yy = memory.phi, memory.moments[0], memory.moments[1], memory.moments[2]
    wxx, wxy, wyy = w * nx * nx, w * nx * ny, w * ny * ny
    for k in range(moments):
        xx[k] += wxx * phi[k]
        xy[k] += wxy * phi[k]
        yy[k] += wyy * phi[k]
    for k in range(terms):
        memory.b[2 * k] += w * r * nx * phi[k]
        memory.b[2 * k + 1] += w * r * ny * phi[k]


@inlined
def _assemble(memory: Memory, terms: int) -> None:
    """Write the lower half of the normal equations' matrix, with the prior on its diagonal."""
    a, moments = memory.a, memory.moments
    for i in range(terms):
        for j in range(i + 1):
            k = PRODUCTS[i, j]
            a[2 * i, 2 * j], a[2 * i + 1, 2 * j + 1] = moments[0, k], moments[2, k]
            a[2 * i + 1, 2 * j] = a[2 * i, 2 * j + 1] = moments[1, k]
    for i in range(2 * terms):
        certain = 1 / CHANGES[_degree(i)] ** 2
        a[i, i] += certain
        memory.b[i] += certain * (memory.prior[i] - memory.field[i])


@inlined
def _step(looks: Looks, n: int, size: Extent, memory: Memory, unknowns: int,
          gate: float) -> int:
    """Update the field by one iteration; return how many normals agreed with it before."""
    agreeing, terms = 0, unknowns // 2
    moments = PRODUCTS[terms - 1, terms - 1] + 1
    memory.moments[:], memory.b[:] = 0.0, 0.0
    for k in range(n):
        place = looks.places[k]
        x, y = scaled(place[WAS_X], place[WAS_Y], size)
        u, v = _cubic(memory.field, 0, x, y), _cubic(memory.field, 1, x, y)
        nx, ny = place[NX], place[NY]
        expected = (place[WAS_X] + u - place[X]) * nx + (place[WAS_Y] + v - place[Y]) * ny
        r = nearest(looks.found[k], looks.counts[k], expected) - expected
        agreeing += abs(r) < AGREES
        if abs(r) < gate:
            _expand(x, y, moments, memory.phi)
            _add(memory, terms, moments, (nx, ny), r, (1 - (r / gate) ** 2) ** 2)
    _assemble(memory, terms)
    factorise(memory.a, unknowns)       # definite, as the prior is
    solve(memory.a, memory.b, unknowns)
    for i in range(unknowns):
        memory.field[i] += memory.b[i]
    return agreeing


@compiled
def estimate(looks: Looks, n: int, size: Extent, memory: Memory) -> float:
    """
    Estimate the motion field from the edges on normals.

    Parameters
    ----------
    looks, n
        Normals and their number, of :func:`looks.look`.
    size
        Of the image.
    memory
        Has the expected field; receives the result.

    Returns
    -------
    Share of the normals with an edge within AGREES px of the motion before the last iteration.

    """
    agreeing = 0
    for i in range(CUBIC):
        memory.field[i] = memory.prior[i]
    for unknowns, gate in STEPS:
        agreeing = _step(looks, n, size, memory, unknowns, gate)
    return agreeing / max(n, 1)
