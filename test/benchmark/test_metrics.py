"""The metrics, on cases worked out by hand."""
from __future__ import annotations

import math

from benchmark.metrics import assign, Comparison, Counts, Figures, sample, Tally
import numpy as np
import pytest


def line(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    """Return a polyline of two points."""
    return np.array([[x0, y0], [x1, y1]], float)


def compare(detections: list[np.ndarray], truth: list[np.ndarray]) -> Comparison:
    """Compare two lists of polylines."""
    return Comparison(sample(detections), sample(truth))


def figures(detections: list[np.ndarray], truth: list[np.ndarray], **rules) -> Figures:
    """Return the figures of one image."""
    return compare(detections, truth).count(**rules).figures()


def test_pieces_have_equal_lengths_and_lie_on_the_line() -> None:
    """A line of 10.4 px is cut into 10 pieces; the first middle lies 0.52 px from the start."""
    samples = sample([line(2, 5, 12.4, 5)])
    assert len(samples.points) == 10
    np.testing.assert_allclose(samples.weight, 1.04)
    np.testing.assert_allclose(samples.points[0], (2.52, 5))
    np.testing.assert_allclose(samples.points[-1], (11.88, 5))
    np.testing.assert_allclose(samples.tangents, np.tile((1.0, 0.0), (10, 1)))


def test_pieces_go_round_corners_and_keep_lines_apart() -> None:
    """Bends and repeated vertices change no length; a line without length has no piece."""
    bent = np.array([[0, 0], [6, 0], [6, 0], [6, 4]], float)
    samples = sample([line(3, 3, 3, 3), bent, line(0, 9, 0, 29)])
    np.testing.assert_allclose(samples.lengths, (0, 10, 20))
    np.testing.assert_allclose(samples.points[samples.line == 1][-1], (6, 3.5))
    np.testing.assert_allclose(samples.points[samples.line == 2][0], (0, 9.5))


def test_tangents_of_a_coarse_polyline_are_those_of_its_curve() -> None:
    """Along a circle of radius 50 px in steps of 10 degrees, tangents err by under 0.3 degrees."""
    angles = np.radians(np.arange(0, 91, 10))
    samples = sample([50 * np.column_stack([np.cos(angles), np.sin(angles)])])
    inner = slice(5, -5)
    radial = samples.points / np.hypot(*samples.points.T)[:, None]
    sines = np.abs((samples.tangents * radial).sum(axis=1))[inner]
    assert sines.max() < math.sin(math.radians(0.3))


def test_half_a_line_beside_the_truth() -> None:
    """50 of 100 px, 1 px off: all is right; the truth is covered 1 px further than that."""
    result = figures([line(0, 1, 50, 1)], [line(0, 0, 100, 0)])
    assert result.precision == 1
    assert result.recall == pytest.approx(0.51)
    assert result.f_measure == pytest.approx(2 * 0.51 / 1.51)
    assert result.rms == pytest.approx(1)
    assert (result.found, result.whole, result.fragments, result.correct) == (0, 0, 1, 1)
    assert result.duplicates == pytest.approx(50 / 51)


def test_a_line_in_two_pieces_is_found_but_not_whole() -> None:
    """Two detections of 45 px each cover 90 and more of 100 px."""
    result = figures([line(0, 0, 45, 0), line(55, 0, 100, 0)], [line(0, 0, 100, 0)])
    assert (result.found, result.whole, result.fragments) == (1, 0, 2)
    assert result.recall == pytest.approx(0.92)


def test_a_line_covered_to_three_quarters_is_whole() -> None:
    """75 px of 100 suffice, 74 do not."""
    truth = [line(0, 0, 100, 0)]
    assert figures([line(0, 0, 75, 0)], truth).whole == 1
    assert figures([line(0, 0, 74, 0)], truth).whole == 0


@pytest.mark.parametrize(('detection', 'precision'), [
    (line(0, 1.9, 100, 1.9), 1), (line(0, 2.1, 100, 2.1), 0),
    (line(100, 1.9, 0, 1.9), 1), (line(0, 30, 100, 30), 0)])
def test_distance_decides_and_direction_does_not(detection: np.ndarray, precision: int) -> None:
    """The tolerance is 2 px; travel may be either way."""
    assert figures([detection], [line(0, 0, 100, 0)]).precision == precision


@pytest.mark.parametrize(('degrees', 'precision'), [(4.9, 1), (5.1, 0)])
def test_angle_decides(degrees: float, precision: int) -> None:
    """Up to 5 degrees match."""
    x, y = 10 * math.cos(math.radians(degrees)), 10 * math.sin(math.radians(degrees))
    assert figures([line(50 - x, -y, 50 + x, y)], [line(0, 0, 100, 0)]).precision == precision


def test_short_truth_is_ignored() -> None:
    """What lies on a line that does not count is neither right nor wrong."""
    truth = [line(0, 0, 100, 0), line(0, 50, 15, 50)]
    found = [line(0, 0, 100, 0), line(0, 50, 15, 50), line(0, 90, 100, 90)]
    result = figures(found, truth, min_truth=20)
    assert (result.precision, result.recall) == (0.5, 1)
    assert (result.detections, result.lines, result.correct) == (2, 1, 0.5)


def test_a_subset_counts_alone() -> None:
    """Of two lines the second counts: the detection of the first is ignored."""
    truth = [line(0, 0, 100, 0), line(0, 50, 100, 50)]
    result = figures([line(0, 0, 100, 0)], truth, subset=[False, True])
    assert (result.recall, result.lines, result.detections) == (0, 1, 0)
    assert math.isnan(result.precision)


def test_duplicates_are_counted() -> None:
    """Every px reported twice."""
    result = figures([line(0, 0, 100, 0), line(0, 1, 100, 1)], [line(0, 0, 100, 0)])
    assert (result.duplicates, result.fragments, result.precision) == (2, 2, 1)
    assert result.rms == pytest.approx(math.sqrt(0.5))


@pytest.mark.parametrize(('found', 'truth'), [([], []), ([], [line(0, 0, 50, 0)]),
                                              ([line(0, 0, 50, 0)], [])])
def test_nothing_is_no_error(found: list[np.ndarray], truth: list[np.ndarray]) -> None:
    """No detection, no truth, or neither: figures are nan or 0."""
    result = figures(found, truth)
    assert (result.detections, result.lines) == (len(found), len(truth))
    assert not result.whole > 0
    assert assign(compare(found, truth)).tally() == Tally(0, len(found), len(truth))


def test_counts_add_up_over_images() -> None:
    """Lengths are added before they are divided: 1 of 100 px and 300 of 300 px."""
    one = compare([], [line(0, 0, 100, 0)]).count()
    other = compare([line(0, 0, 300, 0)], [line(0, 0, 300, 0)]).count()
    assert sum([one, other], Counts()).figures().recall == pytest.approx(0.75)


def test_an_outline_cuts_detections() -> None:
    """40 of 100 px lie inside."""
    outline = np.array([[30, -10], [70, -10], [70, 10], [30, 10]])
    inside = sample([line(0, 0, 100, 0)]).inside(outline)
    assert inside.weight.sum() == pytest.approx(40)


def test_too_large_a_tolerance_is_refused() -> None:
    """Neighbours are looked for to 2 px alone."""
    with pytest.raises(ValueError, match='tolerance is 3'):
        compare([line(0, 0, 50, 0)], [line(0, 0, 50, 0)]).count(3.0)


def test_lines_are_found_by_any_number_of_detections() -> None:
    """Two lines under one detection, one in two pieces, one missed; one detection is wrong."""
    truth = [line(0, 0, 50, 0), line(52, 0, 100, 0), line(0, 50, 100, 50), line(0, 90, 90, 90)]
    found = [line(0, 0, 100, 0), line(0, 50, 45, 50), line(50, 50, 100, 50), line(0, 70, 90, 70)]
    assert compare(found, truth).count().tally() == Tally(right=3, wrong=1, missed=1)


def test_each_line_is_found_once() -> None:
    """The second detection of a line is a false positive, and so is one of a quarter of it."""
    truth = [line(0, 0, 100, 0), line(0, 50, 100, 50)]
    found = [line(0, 0, 100, 0), line(0, 1, 100, 1), line(0, 50, 25, 50)]
    assignment = assign(compare(found, truth))
    assert assignment.line.tolist() == [0, 0, -1]
    assert assignment.tally() == Tally(right=1, wrong=2, missed=1)
    assert assignment.tally(np.array([True, False, False])) == Tally(1, 0, 1)
    assert Tally(1, 2, 1).precision == pytest.approx(1 / 3)
    assert Tally(1, 2, 1).recall == 0.5


def test_a_detection_is_a_line_if_most_of_it_lies_on_it() -> None:
    """100 px cover a line of 60 px, but 40 % lie beyond."""
    truth = [line(0, 0, 60, 0)]
    assert assign(compare([line(0, 0, 100, 0)], truth)).tally() == Tally(0, 1, 1)
    assert assign(compare([line(0, 0, 75, 0)], truth)).tally() == Tally(1, 0, 0)


def test_detections_of_short_lines_are_left_out_of_the_tally() -> None:
    """They are no false positives."""
    assignment = assign(compare([line(0, 0, 15, 0)], [line(0, 0, 15, 0)]), min_truth=20)
    assert assignment.tally() == Tally(0, 0, 0)
