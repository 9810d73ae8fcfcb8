"""
A rosbag2 as a source, with sqlite3 or mcap storage.

Only image messages are deserialised, by their standard definitions.  A recording may contain other
types of messages, even unknown ones.
"""
from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import struct
from typing import Any

import cv2
import numpy as np
from qflsd_ros.sources.encoded import decode
from qflsd_ros.sources.frames import Frame, Report, Source, SourceError
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader
from rosbags.serde import SerdeError
from rosbags.typesys import get_typestore, Stores

RAW, COMPRESSED = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'
ENCODINGS = {(np.dtype(np.uint8), 1): 'mono8', (np.dtype(np.uint8), 3): 'bgr8',
             (np.dtype(np.uint8), 4): 'bgra8', (np.dtype(np.uint16), 1): 'mono16',
             (np.dtype(np.uint16), 3): 'bgr16', (np.dtype(np.uint16), 4): 'bgra16'}


class Bag(Source):
    """
    The images of one topic of a recording, with their stamps and coordinate frame.

    Raw images keep their encoding; compressed images are decoded with ``flags`` of
    ``cv2.imdecode``.

    Attributes
    ----------
    topic
        The topic that is read.
    topics
        All topics with images.
    count
        Number of messages on the topic, by the metadata of the recording.

    """

    def __init__(self, path: Path, topic: str, report: Report,
                 flags: int = cv2.IMREAD_UNCHANGED) -> None:
        super().__init__(repr(str(path)), report)
        self._path, self._flags = path, flags
        self._types = get_typestore(Stores.ROS2_JAZZY)
        with self._open() as reader:
            self.topics = self._image_topics(reader.connections, topic)
            self.topic = topic or self.topics[0]
            if not topic and len(self.topics) > 1:
                self.note = (f'{self.name}: reads {self.topic}, the first of its image topics '
                             f'{", ".join(self.topics)}')
            self.count = sum(connection.msgcount for connection in reader.connections
                             if connection.topic == self.topic)

    @contextmanager
    def _open(self) -> Iterator[Reader]:
        try:
            reader = Reader(self._path)
            reader.open()
        except Exception as error:  # damage raises errors of sqlite3, struct, assertions, ...
            raise SourceError(f'{self.name}: no rosbag2 that can be read: '
                              f'{_one_line(error)}') from error
        try:
            yield reader
        finally:
            reader.close()

    def _image_topics(self, connections: list[Connection], wanted: str) -> list[str]:
        """Return all topics with images; SourceError without any, or without the wanted one."""
        types = {connection.topic: connection.msgtype for connection in connections}
        images = [name for name, kind in types.items() if kind in (RAW, COMPRESSED)]
        if not images:
            raise SourceError(f'{self.name}: no topic of type {RAW} or {COMPRESSED} in this bag, '
                              f'only {", ".join(sorted(set(types.values()))) or "none at all"}')
        if wanted and wanted not in images:
            what = f'is of type {types[wanted]}' if wanted in types else 'is not in this bag'
            raise SourceError(f'{self.name}: topic {wanted} {what}: must be one of its image '
                              f'topics, {", ".join(images)}')
        return images

    def _frames(self) -> Iterator[Frame]:
        with self._open() as reader:
            wanted = [connection for connection in reader.connections
                      if connection.topic == self.topic]
            messages, count = reader.messages(wanted), 0
            while True:
                try:
                    connection, recorded, data = next(messages)
                except StopIteration:
                    return
                except Exception as error:
                    self._skip(f'{self.name}: ends after {count} messages on {self.topic}: '
                               f'it is damaged or was cut short: {_one_line(error)}')
                    return
                count += 1
                try:
                    message = self._types.deserialize_cdr(data, connection.msgtype)
                    yield _frame(message, connection.msgtype, recorded, self._flags)
                except (AssertionError, ValueError, SerdeError, struct.error) as error:
                    self._skip(f'{self.name}: message of {recorded} on {self.topic} cannot be '
                               f'read: {_one_line(error)}')


def _frame(message: Any, kind: str, recorded: int, flags: int) -> Frame:
    """Return the frame of a deserialised Image or CompressedImage."""
    name, stamp = str(recorded), message.header.stamp
    if stamp.nanosec >= 10**9:
        raise ValueError(f'its stamp has {stamp.nanosec} ns: must have less than 10^9 of them')
    times = {'stamp': stamp.sec * 10**9 + stamp.nanosec, 'recorded': recorded,
             'frame_id': message.header.frame_id}
    if kind == RAW:
        return Frame(name, message.height, message.width, message.encoding,
                     bool(message.is_bigendian), message.step, message.data.tobytes(), **times)
    image = decode(message.data.tobytes(), flags, f'format {message.format!r}')
    channels = image.shape[2] if image.ndim == 3 else 1
    if (image.dtype, channels) not in ENCODINGS:
        raise ValueError(f'compressed image of {channels} channels of type {image.dtype}')
    return Frame.of(image, ENCODINGS[image.dtype, channels], name, **times)


def _one_line(error: Exception) -> str:
    return ' '.join(str(error).split()) or type(error).__name__
