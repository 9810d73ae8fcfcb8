"""
Identity of lines over frames, judged by where points of one frame are in another.

Two lines of two frames correspond where half of the shorter one lies on the other, within 2 px and
5 degrees.

========== ========================================================================================
found@k    share by length of the lines (20 px and more) of a frame, in sight k frames later, that
           correspond to a line there
kept@k     of these the share by length that has the same identity there (recall of identity)
right@k    share by length of the pairs of one identity that correspond (precision of identity)
life       mean number of frames in which an identity is seen, of those from 20 px on
often      share of the lines of a frame whose identity is seen in 5 frames or more, by number
twice      share of lines with an identity that another line of the same frame has
========== ========================================================================================

Sums run over all pairs of frames before they are divided.
"""
from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from benchmark.metrics import Comparison, HALF, ratio, sample, Samples
from benchmark.trackers import Tracked
import numpy as np

LAGS = 1, 10, 30
STEP = 4                # frames between those whose lines are looked for later
MIN_LENGTH = 20.0       # px
IN_SIGHT = 0.8          # least share of a line that must be in sight later
TOLERANCE, ANGLE = 2.0, 5.0
OFTEN = 5               # frames, from which on consumers use a line


class Truth(Protocol):
    """A sequence in which the place of a point in other frames is known."""

    def carry(self, pieces: Samples, i: int, j: int) -> np.ndarray:
        """Return the middles (N, 2) px of pieces of frame i in frame j; nan where not in sight."""


class Sums(NamedTuple):
    """Lengths in px of lines in sight, found, kept, of pairs of one identity, and right ones."""

    sight: float = 0.0
    found: float = 0.0
    kept: float = 0.0
    pairs: float = 0.0
    right: float = 0.0

    def plus(self, other: Sums) -> Sums:
        """Return the sums over the frames of both."""
        return Sums(*(a + b for a, b in zip(self, other)))

    @property
    def figures(self) -> tuple[float, float, float]:
        """found, kept, right: nan where nothing could be."""
        return (ratio(self.found, self.sight), ratio(self.kept, self.found),
                ratio(self.right, self.pairs))


class Lives(NamedTuple):
    """Numbers of identities, of their lines, of those seen often, of those whose id is double."""

    identities: int = 0
    lines: int = 0
    often: int = 0
    twice: int = 0
    frames: int = 0

    def plus(self, other: Lives) -> Lives:
        """Return the sums over both."""
        return Lives(*(a + b for a, b in zip(self, other)))


def length(line: np.ndarray) -> float:
    """Return the length of a polyline (K, 2), px."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def carried(truth: Truth, here: Tracked, i: int, j: int) -> Tracked:
    """Return the lines of frame i where they are in frame j, of those in sight there."""
    pieces = sample(here.lines)
    moved = truth.carry(pieces, i, j)
    lines, ids = [], []
    bounds = np.searchsorted(pieces.line, np.arange(pieces.count + 1))
    for identity, first, last in zip(here.ids, bounds, bounds[1:]):
        seen = np.isfinite(moved[first:last]).all(axis=1)
        part = moved[first:last][seen]
        if seen.sum() > IN_SIGHT * len(seen) and length(part) >= MIN_LENGTH:
            lines.append(part)
            ids.append(identity)
    return Tracked(lines, np.array(ids, np.int64))


def compare(truth: Truth, here: Tracked, there: Tracked, i: int, j: int) -> Sums:
    """Judge the identities of the lines of frame i by the lines of frame j."""
    before = carried(truth, here, i, j)
    a, b = sample(before.lines), sample(there.lines)
    if not a.count or not b.count:
        return Sums(float(a.lengths.sum()))
    comparison = Comparison(a, b)
    overlap = comparison.overlap(comparison.lines(TOLERANCE, ANGLE)[0])
    corresponds = overlap >= HALF * np.minimum(a.lengths[:, None], b.lengths)
    same = before.ids[:, None] == there.ids
    return Sums(*(float(a.lengths[rows].sum()) for rows in (
        slice(None), corresponds.any(axis=1), (corresponds & same).any(axis=1),
        same.any(axis=1), (corresponds & same).any(axis=1))))


def over_frames(truth: Truth, found: Sequence[Tracked]) -> dict[int, Sums]:
    """Return the sums of a sequence for each lag."""
    sums = {}
    for lag in LAGS:
        sums[lag] = Sums()
        for i in range(0, len(found) - lag, STEP):
            sums[lag] = sums[lag].plus(compare(truth, found[i], found[i + lag], i, i + lag))
    return sums


def lives(found: Sequence[Tracked]) -> Lives:
    """Count how long identities last in a sequence."""
    seen: Counter[int] = Counter()
    twice = 0
    for frame in found:
        long = [identity for line, identity in zip(frame.lines, frame.ids.tolist())
                if length(line) >= MIN_LENGTH]
        seen.update(set(long))
        twice += len(frame.ids) - len(np.unique(frame.ids))
    often = sum(count for count in seen.values() if count >= OFTEN)
    return Lives(len(seen), sum(seen.values()), often, twice, len(found))
