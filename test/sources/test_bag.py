"""Recordings in both formats as sources."""
from __future__ import annotations

from pathlib import Path
import struct

import cv2
import numpy as np
import pytest
from qflsd_ros.sources import open_source, SourceError
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

TYPES = get_typestore(Stores.ROS2_JAZZY)
TYPES.register(get_types_from_msg('int32 x\nodd_msgs/msg/Deep deep', 'odd_msgs/msg/Odd'))
TYPES.register(get_types_from_msg('float32[3] y', 'odd_msgs/msg/Deep'))
RAW, COMPRESSED = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'
START = 1_600_000_000_123_456_789
both_formats = pytest.mark.parametrize('storage', list(StoragePlugin))


def header(number: int):
    stamp = START + number * 50_000_000
    time = TYPES.types['builtin_interfaces/msg/Time'](stamp // 10**9, stamp % 10**9)
    return TYPES.types['std_msgs/msg/Header'](time, f'lens{number % 2}')


def raw(number: int, encoding: str = 'mono16', step: int = 20):
    data = np.random.default_rng(number).integers(0, 256, 6 * step, np.uint8)
    return TYPES.types[RAW](header(number), 6, 8, encoding, 1, step, data)


def compressed(number: int):
    image = np.full((6, 8, 3), 10 * number, np.uint8)
    return TYPES.types[COMPRESSED](header(number), 'bgr8; png compressed bgr8',
                                   cv2.imencode('.png', image)[1].ravel())


def odd(number: int):
    deep = TYPES.types['odd_msgs/msg/Deep'](np.zeros(3, np.float32))
    return TYPES.types['odd_msgs/msg/Odd'](number, deep)


def write(path: Path, storage: StoragePlugin, topics: dict[str, tuple], count: int = 5) -> str:
    """Write a bag that holds, for each topic, ``count`` messages of a type made by a function."""
    with Writer(path, version=9, storage_plugin=storage) as writer:
        connections = {topic: writer.add_connection(topic, kind, typestore=TYPES)
                       for topic, (kind, _) in topics.items()}
        for number in range(count):
            for topic, (kind, make) in topics.items():
                writer.write(connections[topic], START + 1000 + number * 40_000_000,
                             TYPES.serialize_cdr(make(number), kind))
    return str(path)


@both_formats
def test_messages_come_as_recorded(tmp_path, storage):
    source = open_source(write(tmp_path / 'bag', storage, {'/cam': (RAW, raw)}))
    for _ in range(2):
        frames = list(source)
        assert len(frames) == 5
        for number, frame in enumerate(frames):
            assert frame.data == raw(number).data.tobytes()
            assert frame.stamp == START + number * 50_000_000
            assert frame.recorded == START + 1000 + number * 40_000_000
            assert frame.frame_id == f'lens{number % 2}'
            assert (frame.height, frame.width, frame.step) == (6, 8, 20)
            assert frame.encoding == 'mono16' and frame.is_bigendian
    assert source.skipped == 0


@both_formats
def test_compressed_images_are_decoded(tmp_path, storage):
    bag = write(tmp_path / 'bag', storage, {'/cam': (COMPRESSED, compressed)})
    frames = list(open_source(bag))
    for number, frame in enumerate(frames):
        assert (frame.encoding, frame.step, frame.width) == ('bgr8', 24, 8)
        assert set(frame.data) == {10 * number}
    assert frames[1].stamp == START + 50_000_000 and frames[1].frame_id == 'lens1'


@both_formats
def test_types_that_nobody_knows_do_no_harm(tmp_path, storage):
    topics = {'/odd': ('odd_msgs/msg/Odd', odd), '/cam': (RAW, raw)}
    assert len(list(open_source(write(tmp_path / 'bag', storage, topics)))) == 5


@both_formats
def test_a_storage_file_alone_is_a_bag(tmp_path, storage):
    folder = Path(write(tmp_path / 'bag', storage, {'/cam': (RAW, raw)}))
    file, = (path for path in folder.iterdir() if path.suffix != '.yaml')
    assert len(list(open_source(str(file)))) == 5


@both_formats
def test_topic(tmp_path, storage):
    topics = {'/odd': ('odd_msgs/msg/Odd', odd), '/left': (RAW, raw),
              '/right': (COMPRESSED, compressed)}
    bag = write(tmp_path / 'bag', storage, topics)
    first, second = open_source(bag), open_source(bag, topic='/right')
    assert next(iter(first)).encoding == 'mono16'
    assert 'reads /left, the first of its image topics /left, /right' in first.note
    assert next(iter(second)).encoding == 'bgr8' and second.note == ''
    with pytest.raises(SourceError, match='/odd is of type odd_msgs/msg/Odd: .*/left, /right'):
        open_source(bag, topic='/odd')
    with pytest.raises(SourceError, match='/none is not in this bag: must be .*/left, /right'):
        open_source(bag, topic='/none')


@both_formats
def test_bag_without_images(tmp_path, storage):
    bag = write(tmp_path / 'bag', storage, {'/odd': ('odd_msgs/msg/Odd', odd)})
    with pytest.raises(SourceError, match=f'no topic of type {RAW} .* only odd_msgs/msg/Odd'):
        open_source(bag)


@both_formats
def test_bag_with_an_image_topic_and_no_message(tmp_path, storage):
    source = open_source(write(tmp_path / 'bag', storage, {'/cam': (RAW, raw)}, 0))
    with pytest.raises(SourceError, match='not one frame'):
        list(source)


@both_formats
def test_damaged_message_is_skipped_reported_and_counted(tmp_path, storage):
    with Writer(tmp_path / 'bag', version=9, storage_plugin=storage) as writer:
        cam = writer.add_connection('/cam', COMPRESSED, typestore=TYPES)
        for number in range(4):
            message = compressed(number)
            if number == 1:
                message.data = message.data[:30]
            data = TYPES.serialize_cdr(message, COMPRESSED)
            writer.write(cam, START + number, data[:20] if number == 2 else data)
    reports: list[str] = []
    source = open_source(str(tmp_path / 'bag'), report=reports.append)
    for _ in range(2):
        assert [frame.recorded - START for frame in source] == [0, 3]
        assert source.skipped == len(reports) == 2
    assert all('/cam cannot be read' in report and '\n' not in report for report in reports)


@both_formats
def test_hostile_images_are_refused_before_they_are_decoded(tmp_path, storage):
    def hostile(number: int):
        message = compressed(number)
        if number == 1:  # claims 65536 x 65536 pixels
            message.data[16:24] = np.frombuffer(struct.pack('>II', 65536, 65536), np.uint8)
        if number == 2:
            message.data = cv2.imencode('.tiff', np.zeros((3, 3), np.float32))[1].ravel()
        if number == 3:
            message.header.stamp.nanosec = 2**32 - 1
        return message

    reports: list[str] = []
    source = open_source(write(tmp_path / 'bag', storage, {'/cam': (COMPRESSED, hostile)}),
                         report=reports.append)
    assert len(list(source)) == 2 and len(reports) == 3
    for text, report in zip(('has 65536 x 65536 pixels', 'float32', 'its stamp'), reports):
        assert text in report


@both_formats
@pytest.mark.parametrize('share', [0.0, 0.5, 0.9])
def test_truncated_bag_is_an_error_or_a_report(tmp_path, storage, share):
    folder = Path(write(tmp_path / 'bag', storage, {'/cam': (RAW, raw)}, 50))
    file, = (path for path in folder.iterdir() if path.suffix != '.yaml')
    content = file.read_bytes()
    file.write_bytes(content[:int(share * len(content))])
    reports: list[str] = []
    try:
        assert len(list(open_source(str(folder), report=reports.append))) < 50
        assert reports
    except SourceError as error:
        assert 'bag' in str(error) and '\n' not in str(error)


def test_metadata_that_is_nonsense(tmp_path):
    (tmp_path / 'metadata.yaml').write_text('[1, 2')
    with pytest.raises(SourceError, match='no rosbag2 that can be read'):
        open_source(str(tmp_path))
