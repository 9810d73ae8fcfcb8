"""A map of lines in space, from the planes of tracks and the poses of the camera."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled
from qflsd_ros.core.geometry.found_again import found_again
from qflsd_ros.core.geometry.lines import Lines
from qflsd_ros.core.geometry.planes import Planes
from qflsd_ros.core.geometry.triangulation import AGREED, as_lines, RESULT, results
from qflsd_ros.core.geometry.views import CENTRE, observed, VIEW
from qflsd_ros.core.pose import Pose

# Views that are kept of a track.  More lower the error little, since what is wrong with an edge is
# wrong in many views: 8 instead of 16 raise it by a sixth, 32 lower it by a thirtieth.
VIEWS = 16
# Tracks that are kept, ended ones included: some rooms.
CAPACITY = 4096
# Images in which a line must have been seen; SLAM systems ask for 5 to 10.  Chosen, not tuned.
LEAST_SEEN = 6
# Largest deviation of a line across, as a share of its distance.  Chosen, not tuned: the limit up
# to which a map is of use.
MAX_DEVIATION = 0.011
# Misfit from which on a line must be more exact than that, by their ratio; or the lower quartile
# of all lines if that is larger, as errors of poses and calibration affect all lines.  Edges of
# the rendered room have .1 to .6, lines on its texture .6 to 1.5.  Tuned there; 30 % less or more
# removes 15 % of the lines, or adds as many, most of them on texture.
STEADY, QUARTER = 0.4, 25.0
# Images without a track after which it is removed unless it is confirmed: more than the 60 for
# which the tracker keeps one that it has lost.
PATIENCE = 90
# Share of the views of two lines that must agree with one line in place of both.  Chosen, not
# tuned.
UNITED = 0.8
# Images between two searches for lines that are one: half a second at 30 Hz.  A search takes half
# as long as all else of a map.
SEARCHED = 15


class MappedLines(NamedTuple):
    """
    The confirmed lines of a map, in the order of their tracks.

    Attributes
    ----------
    tracks
        (N,) int64, identities; of an edge that was lost and found again, the first one.
    seen
        (N,) int64, images in which each was seen.
    lines
        N lines.

    """

    tracks: np.ndarray
    seen: np.ndarray
    lines: Lines


class LineMap:
    """
    Lines of the world by their tracks.

    A track that shows the same line as one that ended before continues it.  The memory is flat: of
    each line at most :data:`VIEWS` views are kept, those that are farthest apart, and of
    :data:`CAPACITY` lines those that were seen last.
    """

    def __init__(self) -> None:
        """Begin without lines."""
        self._views = np.zeros((CAPACITY, VIEWS, VIEW))
        self._counts = np.zeros(CAPACITY, np.int64)
        self._seen = np.zeros(CAPACITY, np.int64)
        self._first = np.zeros(CAPACITY, np.int64)
        self._last = np.zeros(CAPACITY, np.int64)
        self._tracks = np.zeros(CAPACITY, np.int64)
        self._results = np.zeros((CAPACITY, RESULT))
        self._changed = np.zeros(CAPACITY, bool)
        self._slots: dict[int, int] = {}            # of tracks, several of which may share one
        self._names: dict[int, list[int]] = {}      # tracks of each slot
        self._free = list(range(CAPACITY - 1, -1, -1))
        self._image, self._searched = 0, 0

    def __len__(self) -> int:
        """Return the number of lines, confirmed or not."""
        return len(self._names)

    def add(self, tracks: np.ndarray, planes: Planes, pose: Pose) -> None:
        """
        Add the planes of one image.

        Parameters
        ----------
        tracks
            (N,) int, the identity of each plane's arc; 0 where it has none: it is left out.
        planes
            N planes.
        pose
            The pose of the optical frame in the world.

        """
        self._image += 1
        known = np.flatnonzero(tracks > 0)
        slots = self._slots_of(tracks[known])
        views = observed(Planes(*(values[known] for values in planes)), pose)
        _keep(self._views, self._counts, slots, views)
        self._seen[slots] += 1
        self._last[slots] = self._image
        self._changed[slots] = True

    def lines(self) -> MappedLines:
        """
        Return the confirmed lines.

        Tracks that ended without being confirmed are removed, and those that are found again
        united with what they were before.
        """
        changed = np.flatnonzero(self._changed)
        self._results[changed] = results(self._views[changed], self._counts[changed])
        self._changed[changed] = False
        used = self._used()
        confirmed = self._confirmed(as_lines(self._results[used]), self._seen[used])
        for slot in used[~confirmed & (self._last[used] < self._image - PATIENCE)]:
            self._remove(slot)
        kept = used[confirmed]
        if self._image >= self._searched + SEARCHED:
            self._searched = self._image
            kept = self._united(kept)
        return MappedLines(self._tracks[kept], self._seen[kept], as_lines(self._results[kept]))

    def _used(self) -> np.ndarray:
        """Return the slots of all lines in the order of their tracks."""
        slots = np.fromiter(self._names, np.int64, len(self._names))
        return slots[np.argsort(self._tracks[slots])]

    def _united(self, slots: np.ndarray) -> np.ndarray:
        """Unite lines that are one, and return the slots that stay, in the same order."""
        pairs = found_again(as_lines(self._results[slots]), self._first[slots], self._last[slots])
        gone = [new for old, new in slots[pairs] if self._unite(old, new)]
        return slots[~np.isin(slots, gone)]

    def _unite(self, old: int, new: int) -> bool:
        """Add the views of a line to those of an earlier one, and return whether they agree."""
        views, counts = self._views[[old]], self._counts[[old]]
        for view in self._views[new, :self._counts[new]]:
            _keep(views, counts, np.zeros(1, np.int64), view[None])
        united = results(views, counts)
        if united[0, AGREED] < UNITED * counts[0] or not as_lines(united).determined[0]:
            return False
        self._views[old], self._counts[old], self._results[old] = views[0], counts[0], united[0]
        self._seen[old] += self._seen[new]
        self._last[old] = self._last[new]
        names = self._names[new]
        self._remove(new)
        self._names[old] += names
        self._slots.update(dict.fromkeys(names, old))
        return True

    @staticmethod
    def _confirmed(lines: Lines, seen: np.ndarray) -> np.ndarray:
        """Return which lines are confirmed, (N,) bool; ``seen`` is in how many images each was."""
        known = np.flatnonzero(lines.determined & (seen >= LEAST_SEEN))
        candidates = lines.chosen(known)
        if len(known):
            steady = max(STEADY, float(np.percentile(candidates.misfits, QUARTER)))
            strict = np.maximum(candidates.misfits / steady, 1)
            known = known[candidates.deviations * strict <= MAX_DEVIATION]
        confirmed = np.zeros(len(seen), bool)
        confirmed[known] = True
        return confirmed

    def _slots_of(self, tracks: np.ndarray) -> np.ndarray:
        """Return the slots of tracks, (N,), of new ones too."""
        new = [track for track in tracks.tolist() if track not in self._slots]
        while len(self._free) < len(new):
            self._remove(min(self._names, key=lambda slot: self._last[slot]))
        for track in new:
            slot = self._slots[track] = self._free.pop()
            self._names[slot] = [track]
            self._tracks[slot], self._counts[slot], self._seen[slot] = track, 0, 0
            self._first[slot] = self._image
        return np.array([self._slots[track] for track in tracks.tolist()], np.int64)

    def _remove(self, slot: int) -> None:
        for track in self._names.pop(int(slot)):
            del self._slots[track]
        self._changed[slot] = False
        self._free.append(slot)


@compiled
def _keep(views: np.ndarray, counts: np.ndarray, slots: np.ndarray, added: np.ndarray) -> None:
    """
    Append a view to each of some tracks.

    Where there is no room, the view between the two nearest neighbours is dropped, so that those
    that stay are spread over the whole way.
    """
    room = views.shape[1]
    for i in range(len(slots)):
        kept, count = views[slots[i]], counts[slots[i]]
        if count == room:
            least, dropped = math.inf, room - 1
            for k in range(1, room):
                square = 0.0
                for c in range(CENTRE, CENTRE + 3):
                    after = kept[k + 1, c] if k + 1 < room else added[i, c]
                    square += (after - kept[k - 1, c]) ** 2
                if square < least:
                    least, dropped = square, k
            for k in range(dropped, room - 1):
                for c in range(views.shape[2]):
                    kept[k, c] = kept[k + 1, c]
            count -= 1
        for c in range(views.shape[2]):
            kept[count, c] = added[i, c]
        counts[slots[i]] = count + 1
