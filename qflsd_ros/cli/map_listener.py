"""The newest map of the line mapper, and its picture."""
from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from qflsd_ros.cli.output.writing import private_room, write_whole
from qflsd_ros.map_drawing import draw_map
from qflsd_ros.ros.output.clouds import records
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

PICTURE = 'map.png'


class MapListener:
    """
    Subscribes to the lines of the mapper.

    Attributes
    ----------
    tracks, ends
        (N,) and (N, 2, 3) m, the lines of the newest map.

    """

    def __init__(self, node: Node) -> None:
        """Subscribe by a node."""
        self.tracks, self.ends = np.zeros(0, np.int64), np.zeros((0, 2, 3))
        node.create_subscription(PointCloud2, 'line_mapper/lines', self._take, 1)

    def write(self, folder: Path, truth: np.ndarray | None) -> Path:
        """
        Write the map as ``map.png`` into a folder; OSError if that is impossible.

        ``truth`` has the true edges, (E, 2, 3) m, if they are known.
        """
        picture = draw_map(self.tracks, self.ends, truth)
        with private_room(folder) as room:
            write_whole(folder, PICTURE, cv2.imencode('.png', picture)[1].tobytes(), room)
        return folder / PICTURE

    def _take(self, message: PointCloud2) -> None:
        rows = records(message)
        self.tracks = rows['track'].astype(np.int64)
        self.ends = np.stack([np.stack([rows[f'{end}_{axis}'] for axis in 'xyz'], axis=1)
                              for end in ('start', 'end')], axis=1)
