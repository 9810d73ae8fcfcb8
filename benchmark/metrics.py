"""
Agreement of detected lines and arcs with annotated ones, both as polylines.

Coordinates are px, x right, y down, (0, 0) is the centre of the top-left pixel.

**Matching.**  Every polyline is cut into equal pieces of about 1 px, each with a middle, a tangent
and a length.  A piece of one set matches the other set when one of the 16 pieces
there that are closest to it lies within ``tolerance`` px across the line of the other set, within
1 px along it, and its tangent within ``angle`` degrees; of several, the closest one across counts.
Detections are matched to the truth, and the truth to the detections.

**Counting.**  Truth lines of at least ``min_truth`` px (and in ``subset``, if it is given) count.
Pieces of detections on other truth lines are ignored: they are neither right nor wrong.

========== ========================================================================================
precision  matched length of the detections, as a share of their length that is not ignored
recall     matched length of the truth, as a share of the length that counts
f_measure  harmonic mean of both
found      share of the lines covered to 75 %, by any number of detections
whole      share of the lines covered to 75 % by one single detection
fragments  mean number of detections on a line (at least 3 px and 3 % of it), over lines covered to
           50 %; 1 is ideal
correct    share of detections, ignored ones apart, with 75 % of their length on one line
duplicates matched length of the detections, over matched length of the truth
rms        root mean square distance of matched pieces from the truth, px
========== ========================================================================================

Sums run over all images before they are divided.

**Lines found** (:meth:`Counts.tally`).  True positives are the lines covered to 75 %, false
negatives the others; false positives are detections of which less than 75 % lies on any lines.

**Lines as wholes** (:func:`assign`).  A detection *is* a line if 75 % of the detection lies on the
line and it covers half of the line or more.  True positives are the lines with such a detection,
false negatives the others.  All other detections are false positives, and so is a second detection
of the same line.
"""
from __future__ import annotations

from collections.abc import Iterable, Sequence
import dataclasses
from dataclasses import dataclass
from functools import cached_property
import math

import cv2
import numpy as np
from scipy.spatial import cKDTree

NEIGHBOURS = 16
STEP = 1.0          # px, length of a piece
ALONG = 1.0         # px
REACH = 2.0         # px, largest tolerance
COVERED = 0.75      # share of a line, or of a detection, that counts as all of it
HALF = 0.5
PIECE = 3.0         # px of a line that make a fragment
PIECE_SHARE = 0.03  # the same as a share of the line


@dataclass(frozen=True)
class Samples:
    """
    Pieces of equal length along polylines.

    Attributes
    ----------
    points, tangents
        (N, 2) float64 px; unit vectors.
    line
        (N,) int64, the polyline that a piece belongs to.
    weight
        (N,) float64 px, the length of a piece.
    count
        Number of polylines.

    """

    points: np.ndarray
    tangents: np.ndarray
    line: np.ndarray
    weight: np.ndarray
    count: int

    @cached_property
    def lengths(self) -> np.ndarray:
        """Length of every polyline in px, (count,)."""
        return np.bincount(self.line, self.weight, self.count)

    def inside(self, outline: np.ndarray) -> Samples:
        """Return the pieces within a polygon, (K, 2) px."""
        outline = np.asarray(outline, np.float32).reshape(-1, 1, 2)
        keep = ((self.points >= outline.min(axis=(0, 1)))
                & (self.points <= outline.max(axis=(0, 1)))).all(axis=1)
        for i in np.flatnonzero(keep):
            keep[i] = cv2.pointPolygonTest(outline, self.points[i].tolist(), True) >= 0
        return Samples(self.points[keep], self.tangents[keep], self.line[keep], self.weight[keep],
                       self.count)


def sample(polylines: Iterable[np.ndarray]) -> Samples:
    """
    Cut (K, 2) px polylines into pieces.

    Between the middles of two chords tangents are interpolated, so that a coarse polyline of a
    smooth curve has the tangents of the curve.
    """
    lines = [np.asarray(line, float).reshape(-1, 2) for line in polylines]
    start, chord, owner = _chords(lines)
    size = np.hypot(chord[:, 0], chord[:, 1])
    length = np.bincount(owner, size, len(lines))
    count = np.where(length > 0, np.maximum(2, np.rint(length / STEP)), 0).astype(int)
    line = np.repeat(np.arange(len(lines)), count)
    if not len(line):
        return Samples(np.zeros((0, 2)), np.zeros((0, 2)), line, np.zeros(0), len(lines))
    weight = (length / np.maximum(count, 1))[line]

    # All lines laid end to end, and how far along them each piece is.
    last = np.cumsum(size)
    first = last - size
    rank = np.arange(len(line)) - (np.cumsum(count) - count)[line]
    along = (np.cumsum(length) - length)[line] + (rank + 0.5) * weight
    at = np.minimum(np.searchsorted(last, along, side='right'), len(last) - 1)
    points = start[at] + chord[at] * ((along - first[at]) / size[at])[:, None]

    middle = (first + last) / 2
    begin = np.searchsorted(owner, line, side='left')
    end = np.searchsorted(owner, line, side='right') - 1
    between = np.clip(along, middle[begin], middle[end])
    unit = chord / size[:, None]
    tangents = np.column_stack([np.interp(between, middle, unit[:, k]) for k in range(2)])
    tangents /= np.maximum(np.hypot(tangents[:, 0], tangents[:, 1]), 1e-9)[:, None]
    return Samples(points, tangents, line, weight, len(lines))


def _chords(lines: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return start, vector and number of the line of every chord longer than 0."""
    if not lines:
        return np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, int)
    vertices = np.concatenate(lines)
    owner = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    chord = np.diff(vertices, axis=0)
    keep = (owner[1:] == owner[:-1]) & (np.hypot(chord[:, 0], chord[:, 1]) > 1e-9)
    return vertices[:-1][keep], chord[keep], owner[:-1][keep]


class Neighbours:
    """Candidates for a match: for every piece of one set, the closest pieces of the other."""

    def __init__(self, here: Samples, there: Samples) -> None:
        self._size = len(here.points)
        self._none = not self._size or not len(there.points)
        if self._none:
            return
        near = min(NEIGHBOURS, len(there.points))
        distance, index = cKDTree(there.points).query(
            here.points, near, distance_upper_bound=math.hypot(REACH, ALONG))
        self._distance = np.reshape(distance, (self._size, near))
        self._index = np.where(np.isfinite(distance), index, 0).reshape(self._size, near)
        offset = here.points[:, None] - there.points[self._index]
        tangent = there.tangents[self._index]
        self._across = offset[..., 1] * tangent[..., 0] - offset[..., 0] * tangent[..., 1]
        self._along = np.abs((offset * tangent).sum(axis=-1))
        self._cosine = np.abs((here.tangents[:, None] * tangent).sum(axis=-1))

    def match(self, tolerance: float, angle: float) -> tuple[np.ndarray, np.ndarray]:
        """Return for each piece here the index of its match, or -1, and its distance in px."""
        if tolerance > REACH:
            raise ValueError(f'tolerance is {tolerance}: must not exceed {REACH} px')
        if self._none:
            return np.full(self._size, -1), np.full(self._size, np.inf)
        admitted = ((self._distance < math.hypot(tolerance, ALONG))
                    & (np.abs(self._across) <= tolerance) & (self._along <= ALONG)
                    & (self._cosine >= math.cos(math.radians(angle))))
        cost = np.where(admitted, np.abs(self._across), np.inf)
        best = cost.argmin(axis=1)
        rows = np.arange(self._size)
        away = cost[rows, best]
        return np.where(np.isfinite(away), self._index[rows, best], -1), away


@dataclass
class Counts:
    """Sums over images; lengths in px."""

    right: float = 0.0          # of detections, on truth that counts
    judged: float = 0.0         # of detections, not ignored
    covered: float = 0.0        # of truth that counts, matched
    truth: float = 0.0          # of truth that counts
    squares: float = 0.0        # px^3, length times squared distance, over ``right``
    correct: int = 0
    wrong: int = 0
    detections: int = 0
    found: int = 0
    whole: int = 0
    lines: int = 0
    fragments: int = 0
    half_covered: int = 0

    def __add__(self, other: Counts) -> Counts:
        """Return the sums over the images of both."""
        return Counts(*(a + b for a, b in zip(dataclasses.astuple(self),
                                              dataclasses.astuple(other))))

    def tally(self) -> Tally:
        """Return the numbers of lines found and missed, and of wrong detections."""
        return Tally(self.found, self.wrong, self.lines - self.found)

    def figures(self) -> Figures:
        """Return the ratios; nan where a denominator is 0."""
        precision, recall = ratio(self.right, self.judged), ratio(self.covered, self.truth)
        return Figures(
            precision, recall, ratio(2 * precision * recall, precision + recall),
            ratio(self.found, self.lines), ratio(self.whole, self.lines),
            ratio(self.fragments, self.half_covered), ratio(self.correct, self.detections),
            ratio(self.right, self.covered), math.sqrt(ratio(self.squares, self.right)),
            self.detections, self.lines)


@dataclass(frozen=True)
class Figures:
    """The figures that the module defines, and the numbers of detections and lines."""

    precision: float
    recall: float
    f_measure: float
    found: float
    whole: float
    fragments: float
    correct: float
    duplicates: float
    rms: float
    detections: int
    lines: int


def ratio(a: float, b: float) -> float:
    """Return a / b, nan for b = 0."""
    return a / b if b else math.nan


class Comparison:
    """Detections and truth of one image."""

    def __init__(self, detections: Samples, truth: Samples) -> None:
        self.detections, self.truth = detections, truth
        self._to_truth = Neighbours(detections, truth)
        self._to_detections = Neighbours(truth, detections)

    def lines(self, tolerance: float, angle: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the truth line under each piece of a detection, or -1, and its distance in px."""
        match, away = self._to_truth.match(tolerance, angle)
        line = np.full(len(match), -1)
        line[match >= 0] = self.truth.line[match[match >= 0]]
        return line, away

    def overlap(self, line: np.ndarray) -> np.ndarray:
        """Return the length in px of each detection on each line, (detections, truth lines)."""
        rows, columns, hit = self.detections.count, self.truth.count, line >= 0
        return np.bincount(self.detections.line[hit] * columns + line[hit],
                           self.detections.weight[hit], rows * columns).reshape(rows, columns)

    def counted(self, min_truth: float, subset: Sequence[bool] | np.ndarray | None) -> np.ndarray:
        """Return which truth lines count, (lines,) bool."""
        lengths = self.truth.lengths
        keep = (lengths >= min_truth) & (lengths > 0)
        return keep if subset is None else keep & np.asarray(subset, bool)

    def count(self, tolerance: float = 2.0, angle: float = 5.0, min_truth: float = 0.0,
              subset: Sequence[bool] | np.ndarray | None = None) -> Counts:
        """Return the counts of this image, as the module defines them."""
        counted = self.counted(min_truth, subset)
        line, away = self.lines(tolerance, angle)
        covered = self._to_detections.match(tolerance, angle)[0] >= 0
        counts = Counts(lines=int(counted.sum()))
        self._count_lengths(counts, counted, line, away, covered)
        self._count_detections(counts, counted, line)
        if len(line) and len(covered):
            self._count_lines(counts, counted, self.overlap(line), covered)
        return counts

    def _count_lengths(self, counts: Counts, counted: np.ndarray, line: np.ndarray,
                       away: np.ndarray, covered: np.ndarray) -> None:
        weight, right = self.detections.weight, _on(counted, line)
        counts.right = float(weight[right].sum())
        counts.judged = float(weight[right | (line < 0)].sum())
        counts.squares = float((weight[right] * away[right] ** 2).sum())
        relevant = counted[self.truth.line]
        counts.truth = float(self.truth.weight[relevant].sum())
        counts.covered = float(self.truth.weight[relevant & covered].sum())

    def _count_detections(self, counts: Counts, counted: np.ndarray, line: np.ndarray) -> None:
        judged = self.judged(counted, line)
        counts.detections = int(judged.sum())
        on_truth = np.bincount(self.detections.line, self.detections.weight * (line >= 0),
                               self.detections.count)
        counts.wrong = int((judged & (on_truth < COVERED * self.detections.lengths)).sum())
        if len(line) and self.truth.count:
            most = self.overlap(line).max(axis=1)
            counts.correct = int((judged & (most >= COVERED * self.detections.lengths)).sum())

    def judged(self, counted: np.ndarray, line: np.ndarray) -> np.ndarray:
        """Return which detections are not ignored, (detections,) bool."""
        ignored = (line >= 0) & ~_on(counted, line)
        on_ignored = np.bincount(self.detections.line, self.detections.weight * ignored,
                                 self.detections.count)
        lengths = self.detections.lengths
        return (lengths > 0) & (on_ignored < COVERED * lengths)

    def _count_lines(self, counts: Counts, counted: np.ndarray, overlap: np.ndarray,
                     covered: np.ndarray) -> None:
        lengths = self.truth.lengths
        covered_length = np.bincount(self.truth.line, self.truth.weight * covered,
                                     self.truth.count)
        counts.found = int((counted & (covered_length >= COVERED * lengths)).sum())
        counts.whole = int((counted & (overlap.max(axis=0) >= COVERED * lengths)).sum())
        pieces = (overlap >= np.maximum(PIECE, PIECE_SHARE * lengths)).sum(axis=0)
        half = counted & (covered_length >= HALF * lengths) & (pieces > 0)
        counts.fragments, counts.half_covered = int(pieces[half].sum()), int(half.sum())


def _on(counted: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return which pieces lie on a line that counts."""
    on = np.zeros(len(line), bool)
    on[line >= 0] = counted[line[line >= 0]]
    return on


@dataclass(frozen=True)
class Assignment:
    """
    Detections of one image, each with the line that it is.

    Attributes
    ----------
    line
        (M,) int64, the line that each detection is, or -1; without ignored detections.
    rows
        (M,) int64, the number of the detection.
    lines
        Number of lines that count.

    """

    line: np.ndarray
    rows: np.ndarray
    lines: int

    def tally(self, keep: np.ndarray | None = None) -> Tally:
        """Count lines as wholes; ``keep`` (detections,) bool selects the detections."""
        line = self.line if keep is None else self.line[keep[self.rows]]
        right = len(np.unique(line[line >= 0]))
        return Tally(right, len(line) - right, self.lines - right)


@dataclass(frozen=True)
class Tally:
    """Numbers of true positives, false positives and false negatives."""

    right: int = 0
    wrong: int = 0
    missed: int = 0

    def __add__(self, other: Tally) -> Tally:
        """Return the sums."""
        return Tally(self.right + other.right, self.wrong + other.wrong,
                     self.missed + other.missed)

    @property
    def precision(self) -> float:
        """Share of the detections that are true positives."""
        return ratio(self.right, self.right + self.wrong)

    @property
    def recall(self) -> float:
        """Share of the lines that are found."""
        return ratio(self.right, self.right + self.missed)


def assign(comparison: Comparison, tolerance: float = 2.0, angle: float = 5.0,
           min_truth: float = 0.0) -> Assignment:
    """Return the assignment of detections to lines."""
    counted = comparison.counted(min_truth, None)
    line, _ = comparison.lines(tolerance, angle)
    rows = np.flatnonzero(comparison.judged(counted, line))
    if not len(rows) or not comparison.truth.count:
        return Assignment(np.full(len(rows), -1), rows, int(counted.sum()))
    overlap = comparison.overlap(line)[rows]
    best = overlap.argmax(axis=1)
    most = overlap[np.arange(len(rows)), best]
    same = (counted[best] & (most >= COVERED * comparison.detections.lengths[rows])
            & (most >= HALF * comparison.truth.lengths[best]))
    return Assignment(np.where(same, best, -1), rows, int(counted.sum()))
