"""Bags with the segments of the bags that were read; without ROS."""
from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np
from qflsd_ros.cli.inputs import Moment
from qflsd_ros.rows import DATATYPES
from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

TOPIC, KIND = '/detector/segments', 'sensor_msgs/msg/PointCloud2'
TYPES = get_typestore(Stores.ROS2_JAZZY)


class Cloud(NamedTuple):
    """Segments of a recorded image: the name of its bag, when it was taken, its rows."""

    bag: str
    moment: Moment
    rows: np.ndarray


def path_of(folder: Path, bag: str) -> Path:
    """Return where the segments of a bag go."""
    return folder / f'{bag}_segments'


class Recordings:
    """
    Writes a bag for each bag that was read: the topic ``/detector/segments``, as the node's.

    A context manager; bags are finished on leaving.
    """

    def __init__(self, folder: Path) -> None:
        """Write into a folder, where none of the bags may exist yet."""
        self._folder = folder
        self._open: dict[str, tuple[Writer, Connection]] = {}
        self._stack = ExitStack()

    def __enter__(self) -> Recordings:
        """Return this."""
        return self

    def __exit__(self, *_: object) -> None:
        """Finish the bags."""
        self._stack.close()

    def write(self, cloud: Cloud) -> None:
        """Write the segments of one image."""
        if cloud.bag not in self._open:
            writer = self._stack.enter_context(Writer(
                path_of(self._folder, cloud.bag), version=9, storage_plugin=StoragePlugin.MCAP))
            self._open[cloud.bag] = writer, writer.add_connection(TOPIC, KIND, typestore=TYPES)
        writer, connection = self._open[cloud.bag]
        writer.write(connection, cloud.moment.recorded, serialised(cloud))


def serialised(cloud: Cloud) -> memoryview | bytes:
    """Return a sensor_msgs/PointCloud2 as CDR, laid out like ``~/segments``."""
    rows, stamp = cloud.rows, cloud.moment.stamp
    time = TYPES.types['builtin_interfaces/msg/Time'](stamp // 10**9, stamp % 10**9)
    header = TYPES.types['std_msgs/msg/Header'](time, cloud.moment.frame_id)
    field = TYPES.types['sensor_msgs/msg/PointField']
    fields = [field(name, offset, DATATYPES[kind.str[1:]], 1)
              for name, (kind, offset) in rows.dtype.fields.items()]
    message = TYPES.types[KIND](
        header, 1, len(rows), fields, False, rows.dtype.itemsize, rows.nbytes,
        rows.view(np.uint8), True)
    return TYPES.serialize_cdr(message, KIND)
