"""
Conversion of arcs into ROS messages, and of point clouds into numpy arrays.

Coordinates are px of the image: x right, y down, (0, 0) at the centre of the top-left pixel.
Every message carries the given header unchanged.
"""
from __future__ import annotations

from array import array

import numpy as np
from qflsd_ros import attitude_drawing as drawing
from qflsd_ros import overlay
from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.attitude.estimation import Attitude
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
    """Return the points of all arcs, with fields and order of ``records.of_segments``."""
    return cloud(header, of_segments(arcs, tolerance))


def arc_records(header: Header, arcs: Arcs) -> PointCloud2:
    """Return one record for each arc, with the fields of :data:`ARC`."""
    return cloud(header, of_arcs(arcs))


def rectified(header: Header, arcs: Arcs, model: DivisionModel) -> PointCloud2:
    """Return straight segments of the undistorted image, see ``records.of_rectified``."""
    return cloud(header, of_rectified(arcs, model))


def plane_records(header: Header, planes: Planes, arcs: Arcs) -> PointCloud2:
    """Return one record for each plane of some arcs, with the fields of :data:`PLANE`."""
    return cloud(header, of_planes(planes, arcs))


def overlay_image(header: Header, gray: np.ndarray, arcs: Arcs, line_width: int,
                  tails: overlay.Tails = overlay.NO_TAILS,
                  attitude: Attitude | None = None) -> Image:
    """Return a grey frame, (H, W) uint8, with arcs, tails and attitude drawn on it, as bgr8."""
    picture = overlay.draw(gray, arcs, line_width, tails)
    if attitude is not None:
        drawing.draw_attitude(picture, attitude, line_width)
    height, width, channels = picture.shape
    return Image(header=header, height=height, width=width, encoding='bgr8',
                 step=channels * width, data=_bytes(picture))


def cloud(header: Header, table: np.ndarray) -> PointCloud2:
    """
    Return a structured array as a point cloud of one row, with one field for each column.

    It is dense unless a value is nan or infinite.
    """
    dense = all(np.isfinite(table[name]).all() for name in table.dtype.names or ())
    fields = [PointField(name=name, offset=offset, datatype=DATATYPES[kind.str[1:]], count=1)
              for name, (kind, offset, *_) in (table.dtype.fields or {}).items()]
    return PointCloud2(
        header=header, height=1, width=len(table), fields=fields, is_bigendian=False,
        point_step=table.dtype.itemsize, row_step=table.nbytes, data=_bytes(table),
        is_dense=dense)


def records(message: PointCloud2) -> np.ndarray:
    """Return a view of a point cloud as a structured array, with one column for each field."""
    order = '>' if message.is_bigendian else '<'
    dtype = np.dtype({
        'names': [field.name for field in message.fields],
        'formats': [order + CODES[field.datatype] for field in message.fields],
        'offsets': [field.offset for field in message.fields],
        'itemsize': message.point_step})
    return np.ndarray(message.width * message.height, dtype, message.data)


def polylines(message: PointCloud2) -> list[np.ndarray]:
    """Return the polylines of a ``~/segments`` message: a list of (K, 2) float32 arrays, px."""
    found = records(message)
    points = np.stack([found['x'], found['y']], axis=1)
    first = np.flatnonzero(np.diff(found['segment'])) + 1
    return np.split(points, first) if len(points) else []


def _bytes(values: np.ndarray) -> array[int]:
    # The setter of the message accepts an array('B') at once; any other type, byte by byte.
    return array('B', values.tobytes())
