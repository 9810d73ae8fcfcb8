"""
The tracker: lines over frames, each with an identity.

In each frame, all tracks are predicted by the motion of the image, measured on its edges and
confirmed by their support.  Detected arcs lengthen confirmed tracks or begin new ones.  A lost
track is kept for some frames, and keeps its identity if it is found again.
"""
from __future__ import annotations

import numpy as np

from qflsd_ros.core.arcs import Arcs, COLUMNS
from qflsd_ros.core.detection.image_circle import ImageCircle
from qflsd_ros.core.detector import Detector, example
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.parameters import Parameters
from qflsd_ros.core.tracking import (
    association, birth, confirmation, measurement, neighbours, report, state)
from qflsd_ros.core.tracking.association import Detected
from qflsd_ros.core.tracking.measurement import Effort, MOST
from qflsd_ros.core.tracking.motion.prediction import Motion
from qflsd_ros.core.tracking.normals import sight
from qflsd_ros.core.tracking.state import Tracks

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
        self._normals, self._outcome = measurement.memory(), association.memory()
        self._reported = report.memory()
        self._points = np.empty((state.MOST, MOST, 2))
        self._confirmed = np.empty(state.MOST, np.bool_)

    @property
    def parameters(self) -> Parameters:
        """Return the parameters of the detector."""
        return self._detector.parameters

    @parameters.setter
    def parameters(self, parameters: Parameters) -> None:
        self._detector.parameters = parameters

    @property
    def circle(self) -> ImageCircle | None:
        """Return the image circle of the last frame; None where none was found or looked for."""
        return self._detector.circle

    def warm_up(self) -> None:
        """Compile all kernels, the detector's too, or load compiled ones from disk."""
        # Images that are searched, the first one and a later one, and one between two searches.
        tracker = Tracker(Parameters(detect_every=2))
        for _ in range(3):
            tracker.track(example()).vertices()

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
            return report.none()
        view, rows = sight(image), self._tracks.rows
        known = len(rows) > 0 and self._motion.predict(view, rows)
        if not known:
            if detected is None:
                detected = self._detect_now(gray, mask, lens)
            self._leave(rows, detected)
        patience = confirmation.PATIENCE if known else confirmation.NEVER
        spacing = measurement.WIDER if detected is None else measurement.SPACING
        measurement.measure(view, rows, Effort(patience, spacing), self._normals, self._points,
                            self._confirmed)
        rows[:, state.HELD] = 1
        if detected is None:
            confirmation.count(rows, self._confirmed, self.parameters.min_score)
        else:
            self._take(rows, detected)
        arcs = report.arcs(image.region, self._tracks.rows, self._points,
                           self.parameters.min_length, self._reported)
        self._tracks.keep_wanted()
        return arcs

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
        self._grid = neighbours.empty(shape)

    def _leave(self, rows: np.ndarray, detected: Arcs) -> None:
        """End all tracks if the frame, whose motion is unknown, shows another scene."""
        reference = np.count_nonzero(rows[:, state.LOST] < self._motion.lost)
        if len(detected) > FEW * reference:
            # The lines of another scene would be taken for those of the last one.
            rows[:, state.LOST] = confirmation.OVER

    def _take(self, rows: np.ndarray, found: Arcs) -> None:
        """Associate detected arcs with the confirmed tracks, and begin tracks with others."""
        arcs = np.ascontiguousarray(found.table).view(np.float64).reshape(-1, COLUMNS)
        order, fates = np.empty((2, len(arcs)), np.int64)
        detected = Detected(arcs, found.table['length'].copy(), order, fates)
        limits = confirmation.Limits(self.parameters.min_distance, self.parameters.min_score)
        confirmation.decide(self._grid, rows, self._confirmed, detected, limits, self._outcome)
        # The detector stores x and y of all edge points one after the other: this copies nothing.
        chains = birth.Chains(np.ascontiguousarray(found.edge_points.T), found.offsets)
        self._tracks.count, self._next = birth.begin(
            detected, chains, birth.Limits(self._next, limits.min_score + confirmation.SURER),
            self._tracks.memory, self._tracks.count, self._points)
