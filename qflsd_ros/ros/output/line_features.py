"""
Lines in the layout that PL-VIO, PL-VINS, EPLF-VINS and PLVINS_ROS2 subscribe to.

Their channels come first, in their order: those systems read channels by number.
"""
from __future__ import annotations

from geometry_msgs.msg import Point32
import numpy as np
from qflsd_ros.core.line_features.undistorted import Lines
from sensor_msgs.msg import ChannelFloat32, PointCloud
from std_msgs.msg import Header


def line_features(header: Header, lines: Lines, ids: np.ndarray, table: np.ndarray
                  ) -> PointCloud:
    """
    Return one point for each line: its start, normalised, with z = 1.

    Parameters
    ----------
    header
        Header of the image.
    lines, ids
        N lines and their ids.
    table
        (N,) rows of the table of their arcs, with ``direction`` and ``track``.

    """
    x_end, y_end = lines.ends.T
    channels = {'id': ids, 'x_end': x_end, 'y_end': y_end, 'std': lines.std,
                'direction': table['direction'], 'track': table['track']}
    return PointCloud(
        header=header, points=[Point32(x=x, y=y, z=1.0) for x, y in lines.starts.tolist()],
        channels=[ChannelFloat32(name=name, values=values.astype(np.float32).tolist())
                  for name, values in channels.items()])
