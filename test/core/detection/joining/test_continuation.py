"""Ends on both sides of a gap: an interruption of one edge, or two edges almost in line."""
from __future__ import annotations

from finding import find
import numpy as np
import pytest
from rendering import render

WIDTH, LEVEL, DARK = 320, 40.3, 60


def interrupted(gap: int, step: float = 0.0, fainter: float = 1.0) -> np.ndarray:
    """
    Return a bright half plane behind a dark post of ``gap`` px.

    To the right of the post its edge is ``step`` px lower, and its contrast ``fainter`` times as
    large.
    """
    gray = render((80, WIDTH), lambda u, v: v - LEVEL - np.where(u < WIDTH / 2, 0, step))
    right = gray[:, WIDTH // 2:]
    right[:] = np.rint(right.min() + fainter * (right.astype(float) - right.min()))
    gray[:, (WIDTH - gap) // 2:(WIDTH + gap) // 2] = gray.min()
    return gray


def is_joined(gray: np.ndarray) -> bool:
    """Return whether one arc runs along both sides of the post."""
    table = find(gray).table
    return bool((table['length'] > 0.9 * WIDTH).any())


@pytest.mark.parametrize('gap', [6, 12, 20])
def test_an_edge_behind_a_post_is_one(gap):
    assert is_joined(interrupted(gap))


@pytest.mark.parametrize('gap', [6, 12, 20])
@pytest.mark.parametrize('step', [-1.4, 1.4])
def test_edges_a_step_apart_are_two(gap, step):
    assert not is_joined(interrupted(gap, step=step))


def test_a_step_that_imperfect_edges_have_is_allowed():
    assert is_joined(interrupted(12, step=0.3))


@pytest.mark.parametrize(('fainter', 'joined'), [(0.7, True), (0.15, False)])
def test_edges_of_different_contrast_are_two(fainter, joined):
    assert is_joined(interrupted(20, fainter=fainter)) == joined
