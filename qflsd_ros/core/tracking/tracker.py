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
from qflsd_ros.core.detection.image_circle import ImageCircle
from qflsd_ros.core.detector import Detector, example
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.parameters import Parameters
from qflsd_ros.core.tracking import chart, confirmation, measurement, report, state
from qflsd_ros.core.tracking.association import associate, NEW, Outcome, PLACES, Tally
from qflsd_ros.core.tracking.measurement import MOST
from qflsd_ros.core.tracking.motion.prediction import Motion
from qflsd_ros.core.tracking.state import Tracks

LAST_IDENTITY = 2 ** 24     # consumers carry identities as float32, which is exact up to there
CLOSER = 0.7        # largest distance of a hidden track, as a share of min_distance; chosen
FEW = 0.25          # arcs per track: with fewer, a frame is empty, not another scene; chosen


class Tracker:
    """
    Follows lines from frame to frame.

    Use one for each camera.  Its attribute ``parameters`` may be replaced between two frames.
    """

    def __init__(self, parameters: Parameters | None = None) -> None:
        """Begin without tracks, with the parameters of the detector (None: the defaults)."""
        self._detector = Detector(parameters)
        self._next = 1
        self._since = 0         # frames since arcs were detected
        self._shape: tuple[int, int] | None = None
        self._tracks, self._motion = Tracks(), Motion()
        self._normals = measurement.memory()
        self._tally = Tally(np.empty(PLACES, np.int64), np.empty(PLACES))
        self._points = np.empty((state.MOST, MOST, 2))

    @property
    def parameters(self) -> Parameters:
        """Return the parameters of the detector."""
        return self._detector.parameters

    @parameters.setter
    def parameters(self, parameters: Parameters) -> None:
        self._detector.parameters = parameters

    @property
    def circle(self) -> ImageCircle | None:
        """The image circle of the last frame; None where none was found or looked for."""
        return self._detector.circle

    def warm_up(self) -> None:
        """Compile all kernels, the detector's too, or load them from numba's cache."""
        tracker = Tracker()
        for _ in range(2):
            tracker.track(example())

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
        detected = self._detect(gray, mask, lens)
        if gray.shape != self._shape:
            self._start((gray.shape[0], gray.shape[1]))
        image = self._detector.frame
        if image is None:
            return report.arcs(np.zeros((0, state.COLUMNS)), np.zeros(0, np.int64),
                               np.zeros((0, 2)), np.zeros((0, MOST, 2)),
                               self.parameters.min_length)
        rows = self._tracks.rows
        known = len(rows) > 0 and self._motion.predict(image, rows)
        if detected is None and not known:
            detected = self._detect_now(gray, mask, lens)
        confirmed = self._measure(image, known, detected)
        rows[:, state.HELD] = 1
        if detected is None:
            self._remember(rows, confirmed)
        else:
            fate = self._compare(rows, confirmed, detected)
            self._remember(rows, confirmed)
            self._begin_tracks(detected, fate == NEW)
        return self._report(image)

    def _detect(self, gray: np.ndarray, mask: np.ndarray | None,
                lens: DivisionModel | None) -> Arcs | None:
        """Return the arcs of a frame, or None if only the tracks are to be measured in it."""
        self._since += 1
        if (self._since < self.parameters.detect_every and self._tracks.count
                and gray.shape == self._shape):
            self._detector.look(gray, mask)
            return None
        return self._detect_now(gray, mask, lens)

    def _detect_now(self, gray: np.ndarray, mask: np.ndarray | None,
                    lens: DivisionModel | None) -> Arcs:
        """Return the arcs of a frame."""
        self._since = 0
        return self._detector.detect(gray, mask, lens)

    def _start(self, shape: tuple[int, int]) -> None:
        """Begin anew with images of another size."""
        self._shape = shape
        self._tracks, self._motion = Tracks(), Motion()
        self._chart = chart.empty(shape)

    def _measure(self, image: Frame, known: bool, detected: Arcs | None) -> np.ndarray:
        """
        Measure all tracks at their predicted places; return which are confirmed: (M,) bool.

        ``known`` is whether the motion is known that predicted them.
        """
        rows = self._tracks.rows
        needed = confirmation.needed(rows, known)
        if not known:
            reference = np.count_nonzero(rows[:, state.LOST] < self._motion.lost)
            if detected is not None and len(detected) > FEW * reference:
                # Another scene: its lines would be taken for those of the last one.
                rows[:, state.LOST] = confirmation.OVER
        measurement.measure(image, rows, needed, self._normals, self._points)
        return rows[:, state.SUPPORT] >= needed

    def _compare(self, rows: np.ndarray, confirmed: np.ndarray, detected: Arcs) -> np.ndarray:
        """Associate detected arcs with the confirmed tracks; return the class of each arc."""
        self._chart.pixels[:] = chart.NOBODY
        chords = np.hypot(rows[:, state.END] - rows[:, state.START],
                          rows[:, state.END + 1] - rows[:, state.START + 1])
        old = (rows[:, state.AGE] >= confirmation.ESTABLISHED) & (rows[:, state.REPORTED] > 0)
        order = np.argsort(-chords * np.where(old, 2.0, 1.0), kind='stable')
        order = order[confirmed[order]]
        hidden, absorbed = np.zeros((2, len(rows)), np.bool_)
        distance = self.parameters.min_distance
        chart.enter_all(self._chart, rows, order, CLOSER * distance, hidden, absorbed)
        confirmed &= ~hidden
        longest = np.argsort(-detected.table['length'], kind='stable')
        outcome = Outcome(np.zeros(len(rows)), np.zeros(len(rows)), absorbed,
                          np.empty(len(detected), np.int64))
        associate(self._chart, rows, _rows_of(detected.table[longest]), distance, self._tally,
                  outcome)
        confirmed &= ~absorbed
        rows[absorbed, state.LOST] = confirmation.OVER
        confirmation.rate(rows, confirmed, outcome)
        fate = np.empty(len(detected), np.int64)
        fate[longest] = outcome.fate
        return fate

    def _remember(self, rows: np.ndarray, confirmed: np.ndarray) -> None:
        """Count frames reported and lost of each track; remove tracks lost for too long."""
        wanted = np.empty(len(rows), np.bool_)
        confirmation.count(rows, confirmed, self.parameters.min_score, wanted)
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
        rows[:, state.REPORTED] = arcs['score'] >= self.parameters.min_score + confirmation.SURER
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
