"""The detector's result: a table with a row for every arc, and the pixels behind each."""
from __future__ import annotations

from dataclasses import dataclass, replace
import math

import numpy as np

from qflsd_ros.core.compilation import compiled

TABLE = np.dtype([
    ('start', np.float64, 2),       # px, on the fitted arc
    ('middle', np.float64, 2),      # px, halfway along the fitted arc
    ('end', np.float64, 2),         # px, on the fitted arc
    ('curvature', np.float64),      # 1/px, > 0 where travel turns from the x axis to the y axis
    ('length', np.float64),         # px, along the arc
    ('rms', np.float64),            # px, of the distances of the edge points from the arc
    ('support', np.int64),          # number of edge points that belong to the arc
    ('curvature_std', np.float64),  # 1/px, standard deviation; of 0 where the arc is straight
    ('offset_std', np.float64),     # px, standard deviation of the position across, at the middle
    ('score', np.float64),          # -log10 of false alarms of independent points (see validation)
    ('contrast', np.float64),       # grey levels, mean step across the arc
    ('polarity', np.float64),       # share of points with the brighter side right, less left: >= 0
    ('bent', np.int64),             # 1 where the curvature is fitted, 0 for the image of a line
])

# The table of a tracker: a detector, which sees one frame at a time, has none of these columns.
TRACKED_TABLE = np.dtype(TABLE.descr + [
    ('track', np.uint32),           # identity, from 1 to 2^24; unique in its frame
    ('age', np.uint32),             # frames in which the track was reported, this one included
    ('held', np.bool_),             # confirmed on its predicted place without a detected arc
])

# All columns that arcs may have, in order.
ALL_COLUMNS = np.dtype([
    *TABLE.descr,
    ('straight', np.float64),       # probability of a straight edge, by a lens; nan if unknown
    *TRACKED_TABLE.descr[len(TABLE.descr):],
    ('direction', np.int64),        # index of a direction of an attitude, -1 for none
])

# TABLE as columns of one float64 array in which kernels fill it, x and y one after the other.
(START, MIDDLE, END, CURVATURE, LENGTH, RMS, SUPPORT, CURVATURE_STD, OFFSET_STD, SCORE, CONTRAST,
 POLARITY, BENT, COLUMNS) = 0, 2, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16


@compiled
def _divide(lengths: np.ndarray, curvatures: np.ndarray, tolerance: float, halves: np.ndarray,
            counts: np.ndarray) -> int:
    """Write half the turn of each arc, radians, and the number of its vertices; return the sum."""
    total = 0
    for i in range(len(lengths)):
        halves[i] = curvatures[i] * lengths[i] / 2
        # The sagitta of a chord that turns by t is (1 - cos(t / 2)) / |curvature|.
        # Twice the chords have a quarter of it.
        bow = min(max(1 - tolerance * abs(curvatures[i]), -1.0), 1.0)
        share = abs(halves[i]) / max(math.acos(bow), 5e-13)
        counts[i] = int(math.ceil(2 * share) if share > 1 else 1) + 1
        total += counts[i]
    return total


@compiled
def _place(starts: np.ndarray, ends: np.ndarray, halves: np.ndarray, counts: np.ndarray,
           points: np.ndarray) -> None:
    """
    Write evenly spaced points of M arcs, one arc after the other.

    Parameters
    ----------
    starts, ends
        (M, 2) float64, px.
    halves
        (M,) float64, half the turn of each arc, radians.
    counts
        (M,) int64, the number of points of each, both ends included.
    points
        (sum of counts, 2) float64, receives the points, px.

    """
    n = 0
    for i in range(len(halves)):
        # With complex numbers, a chord c from the start s, and the part u of half the turn h,
        # a point is s + c exp(i (u - h)) sin(u) / sin(h): as exact for what is all but straight.
        half = halves[i] if halves[i] != 0 else 1e-300
        cosine, sine = math.cos(half), math.sin(half)
        x, y = ends[i, 0] - starts[i, 0], ends[i, 1] - starts[i, 1]
        fx, fy = (x * cosine + y * sine) / sine, (y * cosine - x * sine) / sine
        step = half / (counts[i] - 1)
        for k in range(counts[i]):
            part = step * k
            rise = math.sin(part)
            px, py = rise * math.cos(part), rise * rise
            points[n, 0] = px * fx - py * fy + starts[i, 0]
            points[n, 1] = px * fy + py * fx + starts[i, 1]
            n += 1


@dataclass(frozen=True)
class Arcs:
    """
    The arcs of one image.

    Coordinates are float pixels, x right, y down; (0, 0) is the centre of the top-left pixel.
    Travel along an arc goes from start to end, with the brighter side to the right.

    Attributes
    ----------
    table
        Structured array (M,) of dtype :data:`TABLE`, a row for every arc.  Arcs reach some px
        beyond their outermost edge points, to the ends of their edges.
    edge_points
        (N, 2) float64, the subpixel edge points of all arcs, in order along each of them.
    edge_pixels
        (N, 2) int32, the pixels x, y at which those edge points were found.
    offsets
        (M + 1,) int64: rows ``offsets[i]`` to ``offsets[i + 1]`` of both belong to arc i.

    """

    table: np.ndarray
    edge_points: np.ndarray
    edge_pixels: np.ndarray
    offsets: np.ndarray

    @classmethod
    def empty(cls) -> Arcs:
        """Return a result without any arc."""
        return cls(np.zeros(0, TABLE), np.zeros((0, 2)), np.zeros((0, 2), np.int32),
                   np.zeros(1, np.int64))

    def __len__(self) -> int:
        """Return the number of arcs."""
        return len(self.table)

    @property
    def is_tracked(self) -> bool:
        """Return whether the table has the columns of a tracker."""
        return 'track' in (self.table.dtype.names or ())

    def columns(self) -> dict[str, np.ndarray]:
        """Return the table's columns by name, (M,) each; start becomes start_x and start_y."""
        columns = {}
        for name in self.table.dtype.names or ():
            if self.table.dtype[name].shape:
                columns[f'{name}_x'], columns[f'{name}_y'] = self.table[name].T
            else:
                columns[name] = self.table[name]
        return columns

    def with_columns(self, **columns: np.ndarray) -> Arcs:
        """
        Return the arcs with more columns in a copy of the table, in the order of ALL_COLUMNS.

        Parameters
        ----------
        columns
            (M,) by their names in :data:`ALL_COLUMNS`, which has their types.

        """
        names = {*(self.table.dtype.names or ()), *columns}
        table = np.empty(len(self), [field for field in ALL_COLUMNS.descr if field[0] in names])
        for name in names:
            table[name] = columns[name] if name in columns else self.table[name]
        return replace(self, table=table)

    def pixels(self, i: int) -> np.ndarray:
        """Return the chain behind arc i: (support, 2) int32, x and y, in order along the arc."""
        return self.edge_pixels[self._rows(i)]

    def points(self, i: int) -> np.ndarray:
        """Return the subpixel edge points behind arc i: (support, 2) float64 px."""
        return self.edge_points[self._rows(i)]

    def _rows(self, i: int) -> slice:
        i = range(len(self))[i]
        return slice(self.offsets[i], self.offsets[i + 1])

    def vertices(self, tolerance: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
        """
        Approximate all arcs by polylines, laid one behind the other.

        Parameters
        ----------
        tolerance
            Largest distance in px between an arc and the chords of its polyline, > 0.

        Returns
        -------
        points
            (N, 2) float64 px, on the fitted arcs.
        counts
            (M,) int64, the number of points of each arc, at least 2; exactly 2 where the arc is
            straight to within the tolerance.  Where it is not, chords are so short that on average
            they lie inside the arc by a sixth of the tolerance only.

        Raises
        ------
        ValueError
            The tolerance is not above 0.

        """
        if not tolerance > 0:
            raise ValueError(f'tolerance is {tolerance}: must be above 0 px')
        length, curvature = (self.table[name].astype(np.float64)
                             for name in ('length', 'curvature'))
        half, counts = np.empty(len(self)), np.empty(len(self), np.int64)
        total = _divide(length, curvature, tolerance, half, counts)
        return self._at(half, counts, total), counts

    def _at(self, half: np.ndarray, counts: np.ndarray, total: int) -> np.ndarray:
        """Return evenly spaced points of all arcs, which turn by twice ``half`` radians."""
        points = np.empty((total, 2))
        # Copies, since numba compiles anew for columns that are not aligned.
        _place(self.table['start'].astype(np.float64), self.table['end'].astype(np.float64), half,
               counts, points)
        return points

    def samples(self, count: int) -> np.ndarray:
        """Return ``count`` >= 2 points of each arc, evenly from start to end: (M, count, 2) px."""
        half = self.table['curvature'] * self.table['length'] / 2
        counts = np.full(len(self), count, np.int64)
        return self._at(half, counts, count * len(self)).reshape(len(self), count, 2)

    def scaled(self, factor: int) -> Arcs:
        """
        Return the same arcs in the coordinates of an image ``factor`` times as large.

        A pixel of the small image is a block of ``factor`` x ``factor`` pixels of the large one,
        from (0, 0) on: its centre x lies at ``(x + 0.5) * factor - 0.5``.  An edge pixel
        becomes the pixel at the centre of its block; if factor is even, the upper left one of
        the four at the centre.
        """
        if factor == 1:
            return self

        def place(points: np.ndarray) -> np.ndarray:
            return points * factor + (factor - 1) / 2

        table = self.table.copy()
        for name in ('start', 'middle', 'end'):
            table[name] = place(table[name])
        for name in ('length', 'rms', 'offset_std'):
            table[name] *= factor
        for name in ('curvature', 'curvature_std'):
            table[name] /= factor
        pixels = self.edge_pixels * factor + (factor - 1) // 2
        return Arcs(table, place(self.edge_points), pixels, self.offsets)

    def polylines(self, tolerance: float = 0.1) -> list[np.ndarray]:
        """
        Return every arc as a polyline: a list of (K, 2) float64 arrays, in px.

        K is 2 for arcs that are straight to within ``tolerance`` px.  Raises ValueError if that
        is not above 0.
        """
        points, counts = self.vertices(tolerance)
        ends = np.cumsum(counts).tolist()
        return [points[begin:end] for begin, end in zip([0, *ends], ends)]
