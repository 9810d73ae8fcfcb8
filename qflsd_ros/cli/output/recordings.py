"""Writes the segments of images from bags into new bags, without ROS."""
from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
import secrets
import shutil
from typing import Iterator, NamedTuple

import numpy as np
from qflsd_ros.cli.inputs import Moment
from qflsd_ros.cli.output.writing import publish
from qflsd_ros.records import DATATYPES
from qflsd_ros.sources.frames import Report
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

TOPIC, KIND = '/detector/segments', 'sensor_msgs/msg/PointCloud2'
TYPES = get_typestore(Stores.ROS2_JAZZY)


class Cloud(NamedTuple):
    """Segments of an image from a bag: the name of the bag, time of the image, records."""

    bag: str
    moment: Moment
    rows: np.ndarray


def path_of(folder: Path, bag: str) -> Path:
    """Return the path of the bag that holds the segments of a bag."""
    return folder / f'{bag}_segments'


class Recording:
    """One bag, written in a private folder and then moved to its place."""

    def __init__(self, folder: Path, bag: str, room: Path) -> None:
        """
        Write nothing yet.

        ``folder`` is the folder of the results, ``room`` a private folder in it.
        """
        self._path = path_of(folder, bag)
        # A folder for each bag, since the files of a bag carry its name and must not be renamed.
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
        """Close the bag and move it to its place."""
        assert self._writer is not None
        self._writer.close()
        publish(self._folder / self._path.name, self._path.parent, self._path.name)

    def discard(self) -> None:
        """Remove the unfinished bag."""
        shutil.rmtree(self._folder, ignore_errors=True)


class Recordings:
    """
    Writes one bag for each input bag, with the topic ``/detector/segments`` as the node's.

    A context manager: leaving finishes the bags. A bag that cannot be written, or whose writing
    an exception has interrupted, is removed.
    """

    def __init__(self, folder: Path, room: Path, complain: Report) -> None:
        """
        Write into ``folder``, where none of the bags may exist yet.

        ``room`` is a private folder in it; ``complain`` is called with errors in writing.
        """
        self._folder, self._room, self._complain = folder, room, complain
        self._open: dict[str, Recording] = {}
        self._failed: set[str] = set()

    def __enter__(self) -> Recordings:
        """Return the recordings."""
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
        """Complain about a bag that cannot be written, and write nothing more to it."""
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
              for name, (kind, offset, *_) in (rows.dtype.fields or {}).items()]
    message = TYPES.types[KIND](
        header, 1, len(rows), fields, False, rows.dtype.itemsize, rows.nbytes,
        rows.view(np.uint8), True)
    return TYPES.serialize_cdr(message, KIND)
