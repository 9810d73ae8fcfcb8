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
    phi: np.ndarray         # (TERMS,) float64, the terms of a place
    slope: np.ndarray       # (CUBIC,) float64, derivatives of a distance along a normal


def memory() -> Memory:
    """Return memory with a prior at rest."""
    return Memory(np.zeros(CUBIC), np.zeros(CUBIC), np.empty((CUBIC, CUBIC)), np.empty(CUBIC),
                  np.empty(TERMS), np.empty(CUBIC))


@inlined
def _add(memory: Memory, unknowns: int, normal: tuple[float, float], r: float,
         w: float) -> None:
    """Add the equation of a normal with the residual r, px, and the weight w; phi is set."""
    for i in range(unknowns // 2):
        memory.slope[2 * i] = memory.phi[i] * normal[0]
        memory.slope[2 * i + 1] = memory.phi[i] * normal[1]
    for i in range(unknowns):
        p, row = w * memory.slope[i], memory.a[i]
        memory.b[i] += p * r
        for j in range(i + 1):
            row[j] += p * memory.slope[j]


@compiled
def _step(looks: Looks, n: int, shape: tuple[int, int], memory: Memory, unknowns: int,
          gate: float) -> int:
    """Update the field by one iteration; return how many normals agreed with it before."""
    agreeing, a, b = 0, memory.a, memory.b
    a[:], b[:] = 0.0, 0.0
    for k in range(n):
        place = looks.places[k]
        x, y = scaled(place[WAS_X], place[WAS_Y], shape[1], shape[0])
        _terms(x, y, memory.phi)
        u, v = _at(memory.field, memory.phi)
        nx, ny = place[NX], place[NY]
        expected = (place[WAS_X] + u - place[X]) * nx + (place[WAS_Y] + v - place[Y]) * ny
        r = nearest(looks.found[k], looks.counts[k], expected) - expected
        agreeing += abs(r) < AGREES
        if abs(r) < gate:
            _add(memory, unknowns, (nx, ny), r, (1 - (r / gate) ** 2) ** 2)
    for i in range(unknowns):
        certain = 1 / CHANGES[_degree(i)] ** 2
        a[i, i] += certain
        b[i] += certain * (memory.prior[i] - memory.field[i])
    factorise(a, unknowns)     # definite, as the prior is
    solve(a, b, unknowns)
    for i in range(unknowns):
        memory.field[i] += b[i]
    return agreeing


@compiled
def estimate(looks: Looks, n: int, shape: tuple[int, int], memory: Memory) -> float:
    """
    Estimate the motion field from the edges on normals.

    Parameters
    ----------
    looks, n
        Normals and their number, of :func:`looks.look`.
    shape
        Height and width of the image, px.
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
        agreeing = _step(looks, n, shape, memory, unknowns, gate)
    return agreeing / max(n, 1)
