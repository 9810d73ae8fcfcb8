"""
Arcs as rows of the point clouds in which they are published; imports no ROS.

All coordinates are px of the image; (0, 0) is the centre of the top-left pixel, x right, y down.
"""
from __future__ import annotations

import numpy as np
from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.geometry.planes import Planes
from qflsd_ros.core.lens.division import DivisionModel, rectified
from qflsd_ros.core.lens.estimation import with_straightness

# Points of an arc follow each other from its start to its end; segment is the number of the arc.
SEGMENT_POINT = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('segment', '<u4')])

# x, y, z (the middle of the arc, 0) for RViz, then the columns of the table with 32 bits each.
ARC = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4')] + [
    (name, f'<{column.dtype.kind}4')
    for name, column in with_straightness(Arcs.empty(), None).columns().items()])

# Normal of the plane, upper triangle of its covariance row by row, and the number of the arc.
PLANE = np.dtype(
    [(f'normal_{axis}', '<f4') for axis in 'xyz']
    + [(f'covariance_{axes}', '<f4') for axes in ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')]
    + [('segment', '<u4')])

# What sensor_msgs/PointField calls the types of numpy.
DATATYPES = {'i1': 1, 'u1': 2, 'i2': 3, 'u2': 4, 'i4': 5, 'u4': 6, 'f4': 7, 'f8': 8}


def of_segments(arcs: Arcs, tolerance: float) -> np.ndarray:
    """
    Return the points of all arcs, one behind the other: (N,) of :data:`SEGMENT_POINT`.

    z is 0.  An arc has 2 points where it is straight to within ``tolerance`` px, more where it is
    not.
    """
    points, counts = arcs.vertices(tolerance)
    rows = np.zeros(len(points), SEGMENT_POINT)
    rows['x'], rows['y'] = points.T
    rows['segment'] = np.repeat(np.arange(len(counts)), counts)
    return rows


def of_rectified(arcs: Arcs, model: DivisionModel) -> np.ndarray:
    """
    Return the ends of what straight edges look like without the lens: (2 N,) of SEGMENT_POINT.

    Left out are arcs that are known not to be pictures of straight edges, by their column
    ``straight``, and those that an image without distortion cannot show.
    """
    segments = rectified(arcs, model)
    shown = np.flatnonzero(np.isfinite(segments).all(axis=(1, 2))
                           & ~(arcs.table['straight'] < 0.5))
    rows = np.zeros(2 * len(shown), SEGMENT_POINT)
    rows['x'], rows['y'] = segments[shown].reshape(-1, 2).T
    rows['segment'] = np.repeat(shown, 2)
    return rows


def of_arcs(arcs: Arcs) -> np.ndarray:
    """Return one record for every arc: (M,) of :data:`ARC`; nan where it lacks ``straight``."""
    rows = np.zeros(len(arcs), ARC)
    rows['straight'] = np.nan
    for name, column in arcs.columns().items():
        rows[name] = column
    rows['x'], rows['y'] = arcs.table['middle'].T
    return rows


def of_planes(planes: Planes) -> np.ndarray:
    """Return one record for every plane: (N,) of :data:`PLANE`."""
    rows = np.zeros(len(planes.arcs), PLANE)
    for column, axis in enumerate('xyz'):
        rows[f'normal_{axis}'] = planes.normals[:, column]
    for i, j, name in zip(*np.triu_indices(3), PLANE.names[3:9]):
        rows[name] = planes.covariances[:, i, j]
    rows['segment'] = planes.arcs
    return rows
