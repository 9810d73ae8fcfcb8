"""Cholesky's factorisation A = L L^T of small symmetric matrices, in the memory of the caller."""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import inlined

# Least pivot, relative to the element of the diagonal that it comes from.  Rounding leaves about
# 1e-15 of that where a matrix is singular.
LEAST = 1e-14


@inlined
def factorise(a: np.ndarray, n: int) -> bool:
    """
    Replace the lower triangle of a matrix by its factor L.

    Parameters
    ----------
    a
        (N, N) float64, symmetric.  The upper triangle is neither read nor written.
    n
        Number of rows and columns that count, from the first on.

    Returns
    -------
    Whether the matrix is positive definite.  If it is not, pivots that are too small are raised
    to LEAST, so that a solution exists; it is large in directions that are not determined.

    """
    definite = True
    for r in range(n):
        least = LEAST * a[r, r]
        for c in range(r + 1):
            value = a[r, c]
            for k in range(c):
                value -= a[r, k] * a[c, k]
            if c < r:
                a[r, c] = value / a[c, c]
            else:
                definite = definite and value > least
                a[r, r] = math.sqrt(max(value, least))
    return definite


@inlined
def solve(low: np.ndarray, b: np.ndarray, n: int) -> None:
    """Replace ``b``, (N,), by the solution x of L L^T x = b; ``low`` and ``n`` as above."""
    for r in range(n):
        for k in range(r):
            b[r] -= low[r, k] * b[k]
        b[r] /= low[r, r]
    for r in range(n - 1, -1, -1):
        for k in range(r + 1, n):
            b[r] -= low[k, r] * b[k]
        b[r] /= low[r, r]
