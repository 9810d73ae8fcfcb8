"""
Arcs as ROS messages, and point clouds back as numpy arrays: pure functions.

All coordinates are px of the image; (0, 0) is the centre of the top-left pixel, x right, y down.
Every message carries the header that it is given, as it is.
"""
from __future__ import annotations

from array import array

import numpy as np
from qflsd_ros import overlay
from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.planes import Planes
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header

# Points of an arc follow each other from its start to its end; segment is the number of the arc.
SEGMENT_POINT = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('segment', '<u4')])

# Normal of the plane, upper triangle of its covariance row by row, and the number of the arc.
PLANE = np.dtype(
    [(f'normal_{axis}', '<f4') for axis in 'xyz']
    + [(f'covariance_{axes}', '<f4') for axes in ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')]
    + [('segment', '<u4')])

DATATYPES = {
    'i1': PointField.INT8, 'u1': PointField.UINT8, 'i2': PointField.INT16,
    'u2': PointField.UINT16, 'i4': PointField.INT32, 'u4': PointField.UINT32,
    'f4': PointField.FLOAT32, 'f8': PointField.FLOAT64}
CODES = {datatype: code for code, datatype in DATATYPES.items()}

# x, y, z (the middle of the arc, 0) for RViz, then the columns of the table with 32 bits each.
ARC = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4')] + [
    (name, f'<{column.dtype.kind}4')
    for name, column in Arcs.empty().columns().items()])


def segments(header: Header, arcs: Arcs, tolerance: float) -> PointCloud2:
    """
    Return the arcs as lists of points, one behind the other.

    Fields are those of :data:`SEGMENT_POINT`; z is 0.  An arc has 2 points where it is straight
    to within ``tolerance`` px, more where it is not.
    """
    points, counts = arcs.vertices(tolerance)
    rows = np.zeros(len(points), SEGMENT_POINT)
    rows['x'], rows['y'] = points.T
    rows['segment'] = np.repeat(np.arange(len(counts)), counts)
    return cloud(header, rows)


def arc_records(header: Header, arcs: Arcs) -> PointCloud2:
    """Return one record for every arc; its fields are those of :data:`ARC`."""
    rows = np.zeros(len(arcs), ARC)
    for name, column in arcs.columns().items():
        rows[name] = column
    rows['x'], rows['y'] = arcs.table['middle'].T
    return cloud(header, rows)


def plane_records(header: Header, planes: Planes) -> PointCloud2:
    """Return one record for every plane; its fields are those of :data:`PLANE`."""
    rows = np.zeros(len(planes.arcs), PLANE)
    for column, axis in enumerate('xyz'):
        rows[f'normal_{axis}'] = planes.normals[:, column]
    for (i, j), name in zip(zip(*np.triu_indices(3)), PLANE.names[3:9]):
        rows[name] = planes.covariances[:, i, j]
    rows['segment'] = planes.arcs
    return cloud(header, rows)


def overlay_image(header: Header, gray: np.ndarray, arcs: Arcs, line_width: int) -> Image:
    """Return a grey frame (H, W) uint8 with its arcs drawn on it, encoded as bgr8."""
    picture = overlay.draw(gray, arcs, line_width)
    height, width, channels = picture.shape
    return Image(header=header, height=height, width=width, encoding='bgr8',
                 step=channels * width, data=_bytes(picture))


def cloud(header: Header, rows: np.ndarray) -> PointCloud2:
    """Return a structured array as a point cloud of one row, a field for every column."""
    fields = [PointField(name=name, offset=offset, datatype=DATATYPES[kind.str[1:]], count=1)
              for name, (kind, offset) in rows.dtype.fields.items()]
    return PointCloud2(
        header=header, height=1, width=len(rows), fields=fields, is_bigendian=False,
        point_step=rows.dtype.itemsize, row_step=rows.nbytes, data=_bytes(rows), is_dense=True)


def records(message: PointCloud2) -> np.ndarray:
    """Return a point cloud as a structured array over its own data, a column for every field."""
    order = '>' if message.is_bigendian else '<'
    dtype = np.dtype({
        'names': [field.name for field in message.fields],
        'formats': [order + CODES[field.datatype] for field in message.fields],
        'offsets': [field.offset for field in message.fields],
        'itemsize': message.point_step})
    return np.ndarray(message.width * message.height, dtype, message.data)


def polylines(message: PointCloud2) -> list[np.ndarray]:
    """Return the point lists of a ``~/segments`` message: (K, 2) float32 each, in px."""
    rows = records(message)
    points = np.stack([rows['x'], rows['y']], axis=1)
    first = np.flatnonzero(np.diff(rows['segment'])) + 1
    return np.split(points, first) if len(points) else []


def _bytes(values: np.ndarray) -> array[int]:
    # An array('B') passes the message's setter whole; anything else is checked byte by byte.
    return array('B', values.tobytes())
