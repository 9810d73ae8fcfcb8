"""Bags with the segments of the bags that were read; without ROS."""
from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
import secrets
import shutil
from typing import Iterator, NamedTuple

import numpy as np
from qflsd_ros.cli.inputs import Moment
from qflsd_ros.cli.writing import publish
from qflsd_ros.records import DATATYPES
from qflsd_ros.sources.frames import Report
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


class Recording:
    """One bag, written in a private room."""

    def __init__(self, folder: Path, bag: str, room: Path) -> None:
        """Take the folder of the results and a private room in it; nothing is written yet."""
        self._path = path_of(folder, bag)
        # The files of a bag bear its name.
        self._folder = room / secrets.token_hex(8)
        self._writer: Writer | None = None

    def write(self, cloud: Cloud) -> None:
        """Write the segments of one image."""
        if self._writer is None:
            self._writer = Writer(self._folder / self._path.name, version=9,
                                  storage_plugin=StoragePlugin.MCAP)
            self._writer.open()
            self._connection = self._writer.add_connection(TOPIC, KIND, typestore=TYPES)
        self._writer.write(self._connection, cloud.moment.recorded, serialised(cloud))

    def finish(self) -> None:
        """Bring the whole bag to its place."""
        assert self._writer is not None
        self._writer.close()
        publish(self._folder / self._path.name, self._path.parent, self._path.name)

    def discard(self) -> None:
        """Leave nothing behind."""
        shutil.rmtree(self._folder, ignore_errors=True)


class Recordings:
    """
    Writes a bag for each bag that was read: the topic ``/detector/segments``, as the node's.

    A context manager.  Bags are finished on leaving, and are whole: one that cannot be written, or
    that an exception has cut short, is not there.
    """

    def __init__(self, folder: Path, room: Path, complain: Report) -> None:
        """Write into a folder, where none of the bags may exist yet, with a private room in it."""
        self._folder, self._room, self._complain = folder, room, complain
        self._open: dict[str, Recording] = {}
        self._failed: set[str] = set()

    def __enter__(self) -> Recordings:
        """Return this."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Finish the bags."""
        for bag, recording in list(self._open.items()):
            with self._or_without(bag):
                if kind is None:
                    recording.finish()
                else:
                    recording.discard()

    def write(self, cloud: Cloud) -> None:
        """Write the segments of one image."""
        if cloud.bag in self._failed:
            return
        with self._or_without(cloud.bag):
            if cloud.bag not in self._open:
                self._open[cloud.bag] = Recording(self._folder, cloud.bag, self._room)
            self._open[cloud.bag].write(cloud)

    @contextmanager
    def _or_without(self, bag: str) -> Iterator[None]:
        """Complain about a bag that cannot be written, and do without it from then on."""
        try:
            yield
        except OSError as error:
            self._failed.add(bag)
            if recording := self._open.pop(bag, None):
                recording.discard()
            self._complain(f'{str(path_of(self._folder, bag))!r} cannot be written: {error}')


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
