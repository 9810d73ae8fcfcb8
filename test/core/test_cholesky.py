"""Cholesky's factorisation against numpy."""
from __future__ import annotations

import numpy as np
import pytest
from qflsd_ros.core.cholesky import factorise, solve


def definite(n: int) -> np.ndarray:
    """Return a random positive definite matrix."""
    root = np.random.default_rng(n).normal(size=(n, n))
    return root @ root.T + 0.1 * np.eye(n)


@pytest.mark.parametrize('n, size', [(1, 1), (4, 4), (6, 20), (20, 20)])
def test_it_solves_the_first_equations(n: int, size: int) -> None:
    """The upper triangle and the rows beyond the first n do not matter, and stay."""
    a = np.full((size, size), np.nan)
    a[:n, :n] = np.where(np.tri(n, dtype=bool), definite(n), np.nan)
    b = np.arange(1.0, size + 1)
    assert factorise(a, n)
    assert np.allclose(np.tril(a[:n, :n]), np.linalg.cholesky(definite(n)))
    solve(a, b, n)
    assert np.allclose(definite(n) @ b[:n], np.arange(1.0, n + 1))
    assert np.isnan(a[np.triu_indices(size, 1)]).all()
    assert b[n:].tolist() == list(range(n + 1, size + 1))


@pytest.mark.parametrize('matrix', [
    [[1.0, 1.0], [1.0, 1.0]], [[1.0, 2.0], [2.0, 1.0]], [[0.0, 0.0], [0.0, 1.0]]],
    ids=['singular', 'indefinite', 'an unknown without equations'])
def test_it_says_that_a_matrix_is_not_definite(matrix: list[list[float]]) -> None:
    assert not factorise(np.array(matrix), 2)
