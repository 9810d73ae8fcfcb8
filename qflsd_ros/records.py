"""
The records of the published point clouds, as structured arrays; independent of ROS.

Image coordinates are px; (0, 0) is the centre of the top-left pixel, x points right, y down.
"""
from __future__ import annotations

import numpy as np
from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.geometry.line_map import MappedLines
from qflsd_ros.core.geometry.planes import Planes
from qflsd_ros.core.lens.division import DivisionModel, rectified
from qflsd_ros.core.lens.straightness import with_straightness

# Fields of tracks stay in the layout without tracking too, because readers in C++ cannot ask for a
# field that is not there.  They are 0 then; identities begin at 1.

# A point of an arc; ``segment`` is the number of the arc.  Points are ordered from the start of
# an arc to its end.
SEGMENT_POINT = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('segment', '<u4'),
                          ('track', '<u4')])

# An arc: its middle as x, y, z (z is 0) for RViz, then the columns of the table with 32 bits each.
ARC = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4')] + [
    (name, f'<{column.dtype.kind}4')
    for name, column in with_straightness(Arcs.empty(), None).columns().items()]
    + [('track', '<u4'), ('age', '<u4'), ('held', '<u4'), ('direction', '<i4')])

# A plane: its normal, the upper triangle of its covariance row by row, the number and the
# identity of its arc, and the rays of the arc's ends.
COVARIANCE = ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')
ENDS = ('start', 'end')
PLANE = np.dtype(
    [(f'normal_{axis}', '<f4') for axis in 'xyz']
    + [(f'covariance_{axes}', '<f4') for axes in COVARIANCE]
    + [('segment', '<u4'), ('track', '<u4')]
    + [(f'{end}_{axis}', '<f4') for end in ENDS for axis in 'xyz'])

# A line of the map: its point, its direction, the first of the two directions across (the second
# is direction x across), start and end, the upper triangle of the covariance of two shifts and
# two tilts along these, and its track.
SHIFTS_AND_TILTS = tuple(one + other for i, one in enumerate('xyuv') for other in 'xyuv'[i:])
LINE = np.dtype(
    [('x', '<f4'), ('y', '<f4'), ('z', '<f4')]
    + [(f'{vector}_{axis}', '<f4') for vector in ('direction', 'across', *ENDS) for axis in 'xyz']
    + [(f'covariance_{pair}', '<f4') for pair in SHIFTS_AND_TILTS]
    + [('track', '<u4'), ('seen', '<u4')])

# Codes of numpy's types in sensor_msgs/PointField.
DATATYPES = {'i1': 1, 'u1': 2, 'i2': 3, 'u2': 4, 'i4': 5, 'u4': 6, 'f4': 7, 'f8': 8}


def of_segments(arcs: Arcs, tolerance: float) -> np.ndarray:
    """
    Return the points of all arcs, arc by arc: (N,) of :data:`SEGMENT_POINT`, with z = 0.

    An arc has as many points as its polyline needs to stay within ``tolerance`` px of it: 2 if it
    is straight to within that.
    """
    points, counts = arcs.vertices(tolerance)
    rows = np.zeros(len(points), SEGMENT_POINT)
    rows['x'], rows['y'] = points.T
    rows['segment'] = np.repeat(np.arange(len(counts)), counts)
    rows['track'] = np.repeat(_tracks(arcs), counts)
    return rows


def of_rectified(arcs: Arcs, lens: DivisionModel) -> np.ndarray:
    """
    Return start and end of the rectified arcs: (2 N,) of :data:`SEGMENT_POINT`, with z = 0.

    The result excludes arcs that are unlikely to be images of straight edges (``straight`` below
    0.5) and arcs that the undistorted image cannot show.

    Parameters
    ----------
    arcs
        The arcs of an image, with the column ``straight``.
    lens
        The lens of that image.

    """
    segments = rectified(arcs, lens)
    shown = np.flatnonzero(np.isfinite(segments).all(axis=(1, 2))
                           & ~(arcs.table['straight'] < 0.5))
    rows = np.zeros(2 * len(shown), SEGMENT_POINT)
    rows['x'], rows['y'] = segments[shown].reshape(-1, 2).T
    rows['segment'] = np.repeat(shown, 2)
    rows['track'] = _tracks(arcs)[rows['segment']]
    return rows


def of_arcs(arcs: Arcs) -> np.ndarray:
    """
    Return a record for each arc: (M,) of :data:`ARC`.

    Where the table does not have these columns, ``straight`` is nan, ``track``, ``age`` and
    ``held`` are 0, and ``direction`` is -1.
    """
    rows = np.zeros(len(arcs), ARC)
    rows['straight'], rows['direction'] = np.nan, -1
    for name, column in arcs.columns().items():
        rows[name] = column
    rows['x'], rows['y'] = arcs.table['middle'].T
    return rows


def of_planes(planes: Planes, arcs: Arcs) -> np.ndarray:
    """Return a record for each plane of some arcs: (N,) of :data:`PLANE`."""
    rows = np.zeros(len(planes.arcs), PLANE)
    for column, axis in enumerate('xyz'):
        rows[f'normal_{axis}'] = planes.normals[:, column]
    for number, end in enumerate(ENDS):
        for column, axis in enumerate('xyz'):
            rows[f'{end}_{axis}'] = planes.ends[:, number, column]
    for i, j, axes in zip(*np.triu_indices(3), COVARIANCE):
        rows[f'covariance_{axes}'] = planes.covariances[:, i, j]
    rows['segment'], rows['track'] = planes.arcs, _tracks(arcs)[planes.arcs]
    return rows


def planes_of(rows: np.ndarray) -> tuple[np.ndarray, Planes]:
    """Return the identities, (N,) int64, and the planes of records with the fields of PLANE."""
    covariances = np.empty((len(rows), 3, 3))
    for i, j, axes in zip(*np.triu_indices(3), COVARIANCE):
        covariances[:, i, j] = covariances[:, j, i] = rows[f'covariance_{axes}']
    normals, start, end = (
        np.stack([rows[f'{name}_{axis}'] for axis in 'xyz'], axis=1).astype(float)
        for name in ('normal', *ENDS))
    return rows['track'].astype(np.int64), Planes(
        rows['segment'].astype(np.int64), normals, covariances, np.stack([start, end], axis=1))


def of_lines(mapped: MappedLines) -> np.ndarray:
    """Return a record for each line of a map: (N,) of :data:`LINE`."""
    lines, rows = mapped.lines, np.zeros(len(mapped.tracks), LINE)
    ends = lines.ends
    for name, vectors in (('direction', lines.directions), ('across', lines.across[:, 0]),
                          ('start', ends[:, 0]), ('end', ends[:, 1])):
        for column, axis in enumerate('xyz'):
            rows[f'{name}_{axis}'] = vectors[:, column]
    for i, j, pair in zip(*np.triu_indices(4), SHIFTS_AND_TILTS):
        rows[f'covariance_{pair}'] = lines.covariances[:, i, j]
    rows['x'], rows['y'], rows['z'] = lines.points.T
    rows['track'], rows['seen'] = mapped.tracks, mapped.seen
    return rows


def _tracks(arcs: Arcs) -> np.ndarray:
    """Return the identity of each arc: (M,) uint32, 0 where they have none."""
    return arcs.table['track'] if arcs.is_tracked else np.zeros(len(arcs), np.uint32)
