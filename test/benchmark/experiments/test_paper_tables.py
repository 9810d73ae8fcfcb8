"""Points on a curve of precision against recall."""
from __future__ import annotations

import math

from benchmark.experiments.paper_tables import Curve, curves, Found
from benchmark.metrics import assign, Comparison, sample, Tally
import numpy as np
import pytest

CURVE = Curve(np.array([0.8, 0.6, 0.2]), np.array([0.5, 0.7, 0.9]))


def test_precision_is_read_off_between_points() -> None:
    """Halfway between recalls of 0.6 and 0.8; outside nothing is known."""
    assert CURVE.precision_at(0.7) == pytest.approx(0.6)
    assert math.isnan(CURVE.precision_at(0.9))
    assert math.isnan(CURVE.precision_at(0.1))


def test_recall_is_the_highest_with_that_precision() -> None:
    """Precisions below the curve's lowest are reached at its highest recall."""
    assert CURVE.recall_at(0.8) == pytest.approx(0.4)
    assert CURVE.recall_at(0.3) == pytest.approx(0.8)
    assert math.isnan(CURVE.recall_at(0.95))


def test_the_curve_follows_the_score() -> None:
    """The wrong detection has the lowest score: leaving it out costs no recall."""
    truth = sample([np.array([[0, 0], [100, 0]]), np.array([[0, 50], [100, 50]])])
    found = sample([np.array([[0, 0], [100, 0]]), np.array([[0, 50], [100, 50]]),
                    np.array([[0, 80], [100, 80]])])
    assignment = assign(Comparison(found, truth))
    image = Found(np.array([5.0, 9.0, 1.0]), found, assignment, truth)
    assert image.wholes(5.0) == image.counts(5.0).tally() == Tally(2, 0, 0)
    for curve in curves([image], 'curve', 4).values():
        assert curve.precision[0] == pytest.approx(2 / 3)
        assert curve.precision_at(1.0) >= 2 / 3
        assert curve.recall_at(1.0) == pytest.approx(1)


def test_without_a_score_there_is_one_point() -> None:
    """Peers report no score."""
    found = sample([np.array([[0, 0], [100, 0]])])
    image = Found(np.array([math.nan]), found, assign(Comparison(found, found)), found)
    assert all(len(curve.recall) == 1 for curve in curves([image], 'curve', 4).values())
