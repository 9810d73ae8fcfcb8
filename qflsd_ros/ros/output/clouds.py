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
from qflsd_ros.core.geometry.planes import Planes
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.records import (
    ARC, DATATYPES, of_arcs, of_planes, of_rectified, of_segments, PLANE, SEGMENT_POINT)
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header

__all__ = ['ARC', 'PLANE', 'SEGMENT_POINT', 'arc_records', 'cloud', 'overlay_image',
           'plane_records', 'polylines', 'records', 'rectified', 'segments']

CODES = {datatype: code for code, datatype in DATATYPES.items()}


def segments(header: Header, arcs: Arcs, tolerance: float) -> PointCloud2:
    """Return the arcs as lists of points, see ``records.of_segments``."""
    return cloud(header, of_segments(arcs, tolerance))


def arc_records(header: Header, arcs: Arcs) -> PointCloud2:
    """Return one record for every arc; its fields are those of :data:`ARC`."""
    return cloud(header, of_arcs(arcs))


def rectified(header: Header, arcs: Arcs, model: DivisionModel) -> PointCloud2:
    """Return straight segments in the image without distortion, see ``records.of_rectified``."""
    return cloud(header, of_rectified(arcs, model))


def plane_records(header: Header, planes: Planes) -> PointCloud2:
    """Return one record for every plane; its fields are those of :data:`PLANE`."""
    return cloud(header, of_planes(planes))


def overlay_image(header: Header, gray: np.ndarray, arcs: Arcs, line_width: int) -> Image:
    """Return a grey frame (H, W) uint8 with its arcs drawn on it, encoded as bgr8."""
    picture = overlay.draw(gray, arcs, line_width)
    height, width, channels = picture.shape
    return Image(header=header, height=height, width=width, encoding='bgr8',
                 step=channels * width, data=_bytes(picture))


def cloud(header: Header, table: np.ndarray) -> PointCloud2:
    """
    Return a structured array as a point cloud of one row, a field for every column.

    It is dense unless a value is nan or infinite.
    """
    dense = all(np.isfinite(table[name]).all() for name in table.dtype.names)
    fields = [PointField(name=name, offset=offset, datatype=DATATYPES[kind.str[1:]], count=1)
              for name, (kind, offset) in table.dtype.fields.items()]
    return PointCloud2(
        header=header, height=1, width=len(table), fields=fields, is_bigendian=False,
        point_step=table.dtype.itemsize, row_step=table.nbytes, data=_bytes(table),
        is_dense=dense)


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
    found = records(message)
    points = np.stack([found['x'], found['y']], axis=1)
    first = np.flatnonzero(np.diff(found['segment'])) + 1
    return np.split(points, first) if len(points) else []


def _bytes(values: np.ndarray) -> array[int]:
    # An array('B') passes the message's setter whole; anything else is checked byte by byte.
    return array('B', values.tobytes())
