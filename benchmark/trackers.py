"""
Trackers of lines by name: each takes the frames of a sequence, and gives every line an identity.

``DETECTOR+flow`` follows points along each line by the pyramidal method of Lucas and Kanade: the
line of the next frame where most of them arrive inherits the identity.  ``lsd+lbd`` compares LBD
descriptors, where OpenCV has them.
"""
from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from benchmark.metrics import sample
from benchmark.peers import load, LSD, OURS, TITLES, TOLERANCE
import cv2
import numpy as np
from qflsd_ros.core import Tracker
from scipy.spatial import cKDTree

TRACKER, LBD = 'tracker', 'lsd+lbd'
SPACING = 8.0               # px between the points of a line that are followed
WINDOW, LEVELS = (15, 15), 3
REACH = 2.0                 # px from the place where a point arrives to a line there
ARRIVED = 0.5               # least share of a line's points that must arrive
# Gates of LBD: bits of 256, the values of PL-VINS, and px between middles, about those of PLVS.
BITS, MOVED, TURNED = 30, 60.0, 0.1

# The stubs of OpenCV know neither module nor defaults.
descriptors: Any = getattr(cv2, 'line_descriptor', None)
optical_flow: Any = cv2.calcOpticalFlowPyrLK


class Tracked(NamedTuple):
    """Polylines (K, 2) px of a frame, and the identity of each, (lines,) int64."""

    lines: list[np.ndarray]
    ids: np.ndarray


class Following(Protocol):
    """A tracker of one sequence; ``bare`` is its detector alone, for comparison of times."""

    def __call__(self, gray: np.ndarray) -> Tracked:
        """Take the next frame, (H, W) uint8."""

    def bare(self, gray: np.ndarray) -> Any:
        """Detect lines in a frame alone."""


class Ours:
    """The tracker of the package."""

    def __init__(self) -> None:
        self._tracker, self.bare = Tracker(), load(OURS).detect

    def __call__(self, gray: np.ndarray) -> Tracked:
        """Take the next frame, (H, W) uint8."""
        arcs = self._tracker.track(gray)
        return Tracked(arcs.polylines(TOLERANCE), arcs.table['track'].astype(np.int64))


class Flow:
    """Any detector, and optical flow of points along its lines."""

    def __init__(self, name: str) -> None:
        self._peer, self._next = load(name), 0
        self.bare = self._peer.detect
        self._last: tuple[np.ndarray, Tracked] | None = None

    def __call__(self, gray: np.ndarray) -> Tracked:
        """Take the next frame, (H, W) uint8."""
        lines = self._peer(gray)
        ids = np.full(len(lines), -1, np.int64)
        if self._last is not None and lines and self._last[1].lines:
            for before, after in self._pairs(gray, lines):
                ids[after] = self._last[1].ids[before]
        fresh = ids < 0
        ids[fresh] = self._next + np.arange(fresh.sum())
        self._next += int(fresh.sum())
        self._last = gray, Tracked(lines, ids)
        return self._last[1]

    def _pairs(self, gray: np.ndarray, lines: list[np.ndarray]) -> list[tuple[int, int]]:
        """Return the numbers of lines before and of those now where most of their points are."""
        assert self._last is not None
        image, before = self._last
        points, line = _spaced(before.lines)
        moved, ok, _ = optical_flow(image, gray, points.astype(np.float32).reshape(-1, 1, 2), None,
                                    winSize=WINDOW, maxLevel=LEVELS)
        here = sample(lines)
        distance, index = cKDTree(here.points).query(moved.reshape(-1, 2))
        hit = (ok.ravel() == 1) & (distance <= REACH)
        arrived = here.line[np.asarray(index)[hit]]
        votes = Counter(zip(line[hit].tolist(), arrived.tolist()))
        total = np.bincount(line, minlength=len(before.lines))
        pairs: dict[int, int] = {}
        taken: set[int] = set()
        for (old, new), count in votes.most_common():
            if count >= ARRIVED * total[old] and old not in pairs and new not in taken:
                pairs[old] = new
                taken.add(new)
        return list(pairs.items())


class Described:
    """LSD, and the nearest LBD descriptors within gates (Zhang and Koch 2013)."""

    def __init__(self) -> None:
        self._next = 0
        self._detector = descriptors.LSDDetector_createLSDDetector()
        self._descriptor = descriptors.BinaryDescriptor_createBinaryDescriptor()
        self._last: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

    def bare(self, gray: np.ndarray) -> Any:
        """Detect lines in a frame alone."""
        return self._detector.detect(gray, 2, 1)

    def __call__(self, gray: np.ndarray) -> Tracked:
        """Take the next frame, (H, W) uint8."""
        found = list(self.bare(gray))
        bits = np.zeros((0, 32), np.uint8)
        if found:
            found, bits = self._descriptor.compute(gray, found)
        ends = np.array([(key.startPointX, key.startPointY, key.endPointX, key.endPointY)
                         for key in found], float).reshape(-1, 2, 2)
        angles = np.array([key.angle for key in found])
        look = np.c_[np.unpackbits(bits, axis=1), ends.mean(axis=1), angles]
        ids = np.full(len(ends), -1)
        if self._last is not None and len(self._last[0]) and len(look):
            before, after = _nearest(self._last[0], look)
            ids[after] = self._last[1][before]
        fresh = ids < 0
        ids[fresh] = self._next + np.arange(fresh.sum())
        self._next += int(fresh.sum())
        self._last = look, ids, ends
        return Tracked(list(ends), ids)


def _spaced(lines: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return points along lines, the middle of each at least, and the number of their line."""
    pieces = sample(lines)
    keep = np.zeros(len(pieces.line), bool)
    for first, last in zip(np.searchsorted(pieces.line, np.arange(len(lines))),
                           np.searchsorted(pieces.line, np.arange(len(lines)), 'right')):
        count = max(int((last - first) / SPACING), 1)
        if last > first:
            keep[first + ((np.arange(count) + 0.5) * (last - first) / count).astype(int)] = True
    return pieces.points[keep], pieces.line[keep]


def _nearest(before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of rows, each the other's nearest by its bits, that are within the gates."""
    bits = np.abs(before[:, None, :256] - after[None, :, :256]).sum(axis=2)
    moved = np.linalg.norm(before[:, None, 256:258] - after[None, :, 256:258], axis=2)
    turned = np.abs(np.angle(np.exp(1j * (before[:, None, 258] - after[None, :, 258]))))
    bits[(moved > MOVED) | (turned > TURNED)] = np.inf
    best, other = bits.argmin(axis=1), bits.argmin(axis=0)
    rows = np.flatnonzero((other[best] == np.arange(len(before))) & (bits.min(axis=1) < BITS))
    return rows, best[rows]


def available() -> tuple[str, ...]:
    """Return the names of the trackers that can run."""
    return (f'{LSD}+flow', *((LBD,) if descriptors is not None else ()), f'{OURS}+flow', TRACKER)


def begin(name: str) -> Following:
    """Return a tracker, by its name, that has seen no frame."""
    makers: dict[str, Callable[[], Following]] = {TRACKER: Ours, LBD: Described}
    if name in makers:
        return makers[name]()
    return Flow(name.removesuffix('+flow'))


def title(name: str) -> str:
    """Return the name of a tracker in tables."""
    detector, _, method = name.partition('+')
    if name == TRACKER:
        return TITLES[OURS]
    return f'{TITLES[detector]}, {"LBD" if method == "lbd" else "optical flow"}'
