"""
The tracker: lines over frames, each with an identity.

In each frame, all tracks are predicted by the motion of the image, measured on its edges and
confirmed by their support.  Detected arcs lengthen confirmed tracks or begin new ones.  A lost
track is kept for some frames, and keeps its identity if it is found again.
"""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.detection.frame import Frame
from qflsd_ros.core.detector import Detector
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.parameters import Parameters
from qflsd_ros.core.tracking import report, state
from qflsd_ros.core.tracking.association import associate, NEW, Outcome, PLACES, Tally
from qflsd_ros.core.tracking.chart import enter_all, NOBODY
from qflsd_ros.core.tracking.measurement import measure, MOST
from qflsd_ros.core.tracking.motion import Motion
from qflsd_ros.core.tracking.normals import EDGES
from qflsd_ros.core.tracking.state import Tracks

LAST_IDENTITY = 2 ** 24     # consumers carry identities as float32, which is exact up to there
# All of the following but SUPPORTED are chosen, not tuned.
# Least share of supported normals of a track of the last frame.  Tuned on photographs seen by a
# turning camera: of 0.3 to 0.5, 0.3 keeps most identities, and as many lines are right (to 0.001).
SUPPORTED = 0.3
FOUND_AGAIN = 0.6           # the same for a lost track
NEVER = 2.0                 # the same, above any share, so that no track is confirmed
# Least score of a reported track, relative to min_score: of a new one, and of one reported in the
# last frame (hysteresis).
SURER, LESS = 2.0, -3.0
CLOSER = 0.7                # largest distance of a hidden track, as a share of min_distance
PATIENCE = 60               # frames for which a lost track is kept that was established
ESTABLISHED = 3             # frames in which a track must have been reported to be established
YOUNG = 5                   # frames for which other lost tracks are kept
FORGOTTEN = 1.0             # score below which a track ends
RECENT = 0.9                # weight of the past in running means over frames
COVERED = 0.5               # least share of a track's chord with arcs on it, to be detected
FEW = 0.25                  # arcs per track: with fewer, a frame is empty, not another scene


class Tracker:
    """
    Follows lines from frame to frame.

    Use one for each camera.  Its attribute ``parameters`` may be replaced between two frames.
    """

    def __init__(self, parameters: Parameters | None = None) -> None:
        """Begin without tracks, with the parameters of the detector (None: the defaults)."""
        self._detector = Detector(parameters)
        self._next = 1
        self._shape: tuple[int, int] | None = None
        self._shares, self._counts = np.empty(MOST), np.empty(MOST, np.int64)
        self._found, self._strength = np.empty((2, MOST, EDGES))
        self._tally = Tally(np.empty(PLACES, np.int64), np.empty(PLACES))
        self._points = np.empty((state.MOST, MOST, 2))

    @property
    def parameters(self) -> Parameters:
        """Return the parameters of the detector."""
        return self._detector.parameters

    @parameters.setter
    def parameters(self, parameters: Parameters) -> None:
        self._detector.parameters = parameters

    def warm_up(self) -> None:
        """Compile all kernels, the detector's too, or load them from numba's cache."""
        gray = np.zeros((64, 64), np.uint8)
        gray[16:48, 16:48] = 255
        tracker = Tracker()
        for _ in range(2):
            tracker.track(gray)

    def track(self, gray: np.ndarray, mask: np.ndarray | None = None,
              lens: DivisionModel | None = None) -> Arcs:
        """
        Return the lines of the next frame.

        Parameters
        ----------
        gray, mask, lens
            As of :meth:`Detector.detect`.  A frame of another size ends all tracks; the identities
            of new ones continue the count.

        Returns
        -------
        Arcs with a table of dtype :data:`arcs.TRACKED_TABLE`.  An identity is unique in the frame,
        and its arc keeps the direction of travel over frames.  The ``edge_points`` of an arc that
        was measured are the edges on its normals, a few px apart.

        Raises
        ------
        TypeError, ValueError
            As :meth:`Detector.detect`; ValueError with method paper, which leaves no gradients.

        """
        if self.parameters.method == 'paper':
            raise ValueError('method is paper: tracks need the gradients of method arcs')
        detected = self._detector.detect(gray, mask, lens)
        if gray.shape != self._shape:
            self._start((gray.shape[0], gray.shape[1]))
        image = self._detector.frame
        if image is None:
            return report.arcs(np.zeros((0, state.COLUMNS)), np.zeros(0, np.int64),
                               np.zeros((0, 2)), np.zeros((0, MOST, 2)),
                               self.parameters.min_length)
        rows = self._tracks.rows
        confirmed = self._follow(image, len(detected))
        fate = self._compare(rows, confirmed, detected)
        self._remember(rows, confirmed)
        self._begin_tracks(detected, fate == NEW)
        return self._report(image)

    def _start(self, shape: tuple[int, int]) -> None:
        """Begin anew with images of another size."""
        self._shape = shape
        self._tracks, self._motion = Tracks(), Motion()
        self._chart = np.full(shape, NOBODY, np.int16)

    def _follow(self, image: Frame, arcs: int) -> np.ndarray:
        """Predict and measure all tracks; return which are confirmed: (M,) bool."""
        rows = self._tracks.rows
        if len(rows) == 0:
            return np.zeros(0, np.bool_)
        reference = np.count_nonzero(rows[:, state.LOST] <= self._motion.lost)
        needed = np.where(rows[:, state.LOST] > 0, FOUND_AGAIN, SUPPORTED)
        if not self._motion.predict(image, rows):
            needed[:] = NEVER
            if arcs > FEW * reference:
                # Another scene: its lines would be taken for those of the last one.
                rows[:, state.LOST] = 2 * PATIENCE
        measure(image, rows, needed, self._shares, self._found, self._counts, self._strength,
                self._points)
        return rows[:, state.SUPPORT] >= needed

    def _compare(self, rows: np.ndarray, confirmed: np.ndarray, detected: Arcs) -> np.ndarray:
        """Associate detected arcs with the confirmed tracks; return the class of each arc."""
        self._chart[:] = NOBODY
        chords = np.hypot(rows[:, state.END] - rows[:, state.START],
                          rows[:, state.END + 1] - rows[:, state.START + 1])
        established = (rows[:, state.AGE] >= ESTABLISHED) & (rows[:, state.REPORTED] > 0)
        rank = chords * np.where(established, 2.0, 1.0)
        order = np.argsort(-rank, kind='stable')
        order = order[confirmed[order]]
        hidden, absorbed = np.zeros((2, len(rows)), np.bool_)
        distance = self.parameters.min_distance
        enter_all(self._chart, rows, order, CLOSER * distance, hidden, absorbed)
        confirmed &= ~hidden
        longest = np.argsort(-detected.table['length'], kind='stable')
        outcome = Outcome(np.zeros(len(rows)), np.zeros(len(rows)), absorbed,
                          np.empty(len(detected), np.int64))
        associate(self._chart, rows, _rows_of(detected.table[longest]), distance, self._tally,
                  outcome)
        confirmed &= ~absorbed
        rows[absorbed, state.LOST] = 2 * PATIENCE
        seen = outcome.covered >= COVERED * chords
        rows[:, state.HELD] = ~seen
        weight = np.where(confirmed, 1 - RECENT, 0.0)
        rows[:, state.SCORE] += weight * (outcome.scores - rows[:, state.SCORE])
        rows[:, state.DETECTED] += (1 - RECENT) * (seen - rows[:, state.DETECTED])
        fate = np.empty(len(detected), np.int64)
        fate[longest] = outcome.fate
        return fate

    def _remember(self, rows: np.ndarray, confirmed: np.ndarray) -> None:
        """Count frames reported and lost of each track; remove tracks lost for too long."""
        rows[:, state.CONFIRMED] = confirmed
        least = self.parameters.min_score + np.where(rows[:, state.REPORTED], LESS, SURER)
        rows[:, state.REPORTED] = confirmed & (rows[:, state.SCORE] >= least)
        rows[:, state.LOST] = np.where(confirmed, 0, rows[:, state.LOST] + 1)
        patience = np.where(rows[:, state.AGE] + rows[:, state.REPORTED] >= ESTABLISHED,
                            PATIENCE, YOUNG)
        wanted = (rows[:, state.LOST] <= patience) & (rows[:, state.SCORE] >= FORGOTTEN)
        if not wanted.all():
            kept = self._points[:len(rows)][wanted]
            self._points[:len(kept)] = kept
            self._tracks.keep(wanted)

    def _begin_tracks(self, detected: Arcs, new: np.ndarray) -> None:
        """Begin a track with each arc that ``new``, (N,) bool, marks."""
        chosen = np.flatnonzero(new)[:state.MOST - self._tracks.count]
        arcs = detected.table[chosen]
        rows = _rows_of(arcs)
        rows[:, state.EDGES] = np.minimum(arcs['support'], MOST)
        rows[:, state.IDENTITY] = self._identities(len(chosen))
        rows[:, state.DETECTED] = rows[:, state.CONFIRMED] = 1
        sure = arcs['score'] >= self.parameters.min_score + SURER
        rows[:, state.REPORTED] = sure
        rows[:, state.FIRST], rows[:, state.LAST] = -1, 1
        # Of each arc as many points, evenly from the first to the last, as there is room for.
        last = np.minimum(np.arange(MOST), rows[:, [state.EDGES]] - 1)
        share = last / np.maximum(rows[:, [state.EDGES]] - 1, 1)
        every = (share * (arcs['support'][:, None] - 1)).astype(np.int64)
        first = self._tracks.count
        self._points[first:first + len(chosen)] = detected.edge_points[
            detected.offsets[chosen][:, None] + every]
        self._tracks.add(rows)

    def _identities(self, count: int) -> np.ndarray:
        """Return new identities: after LAST_IDENTITY again from 1, without those in use."""
        alive = set(self._tracks.rows[:, state.IDENTITY].astype(np.int64).tolist())
        chosen: list[int] = []
        while len(chosen) < count:
            if self._next not in alive:
                chosen.append(self._next)
            self._next = self._next % LAST_IDENTITY + 1
        return np.array(chosen, np.int64)

    def _report(self, image: Frame) -> Arcs:
        """Return the confirmed tracks as arcs."""
        rows = self._tracks.rows
        chosen = np.flatnonzero(rows[:, state.REPORTED])
        parts = np.empty((len(rows), 2))
        report.in_sight(image, rows, chosen, parts)
        return report.arcs(rows, chosen, parts, self._points, self.parameters.min_length)


def _rows_of(table: np.ndarray) -> np.ndarray:
    """Return the rows of tracks, (N, COLUMNS), that begin with the arcs of a table."""
    rows = np.zeros((len(table), state.COLUMNS))
    for column, name in ((state.START, 'start'), (state.MIDDLE, 'middle'), (state.END, 'end')):
        rows[:, column:column + 2] = table[name]
    for column, name in ((state.CONTRAST, 'contrast'), (state.POLARITY, 'polarity'),
                         (state.SCORE, 'score'), (state.RMS, 'rms')):
        rows[:, column] = table[name]
    return rows
