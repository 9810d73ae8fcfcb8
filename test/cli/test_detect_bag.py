"""The command detect reads rosbag2s, and writes bags with segments like those of the node."""
from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys

import cv2
import numpy as np
import pytest
from qflsd_ros.cli.detect import main
from qflsd_ros.core import Tracker
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

TYPES = get_typestore(Stores.ROS2_JAZZY)
RAW, COMPRESSED = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'
START = 1_600_000_000_123_456_789


def gray(number: int) -> np.ndarray:
    pixels = np.full((120, 160), 40, np.uint8)
    cv2.rectangle(pixels, (20 + 5 * number, 20), (100 + 5 * number, 90), 200, -1)
    return pixels


def header(number: int):
    stamp = START + number * 50_000_000
    time = TYPES.types['builtin_interfaces/msg/Time'](stamp // 10**9, stamp % 10**9)
    return TYPES.types['std_msgs/msg/Header'](time, 'lens')


def message(number: int, kind: str):
    if kind == RAW:
        encoding = 'unheard' if number == 3 else 'mono16'
        data = (gray(number) * np.uint16(257)).view(np.uint8).ravel()
        return TYPES.types[RAW](header(number), 120, 160, encoding, 0, 320, data)
    data = cv2.imencode('.png', gray(number))[1].ravel()
    return TYPES.types[COMPRESSED](header(number), 'png', data)


def make_bag(path: Path, kind: str, storage: StoragePlugin = StoragePlugin.MCAP) -> Path:
    with Writer(path, version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection('/cam/image', kind, typestore=TYPES)
        for number in range(5):
            writer.write(connection, START + 1000 + number * 50_000_000,
                         TYPES.serialize_cdr(message(number, kind), kind))
    return path


def check(bag: Path, numbers: list[int]) -> None:
    """Check that a bag holds the segments of these images, at their times."""
    with Reader(bag) as reader:
        found = [(recorded, TYPES.deserialize_cdr(data, connection.msgtype))
                 for connection, recorded, data in reader.messages()]
        assert set(reader.topics) == {'/detector/segments'}
    assert len(found) == len(numbers)
    tracker = Tracker()
    for number, (recorded, cloud) in zip(numbers, found):
        assert recorded == START + 1000 + number * 50_000_000
        assert cloud.header == header(number)
        assert [(field.name, field.offset, field.datatype, field.count)
                for field in cloud.fields] == [
            ('x', 0, 7, 1), ('y', 4, 7, 1), ('z', 8, 7, 1), ('segment', 12, 6, 1),
            ('track', 16, 6, 1)]
        rows = cloud.data.view([('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('segment', '<u4'),
                                ('track', '<u4')])
        assert (cloud.width, cloud.height, cloud.point_step) == (len(rows), 1, 20)
        arcs = tracker.track(gray(number))
        points, counts = arcs.vertices(0.1)
        assert len(counts) >= 4
        assert np.abs(np.stack([rows['x'], rows['y']], 1) - points).max() < 1e-4
        assert rows['segment'].tolist() == np.repeat(np.arange(len(counts)), counts).tolist()
        assert rows['track'].tolist() == np.repeat(arcs.table['track'], counts).tolist()


@pytest.mark.parametrize('storage', list(StoragePlugin))
def test_a_bag_of_compressed_images(tmp_path: Path, storage: StoragePlugin) -> None:
    bag = make_bag(tmp_path / 'drive', COMPRESSED, storage)
    output = tmp_path / 'found'
    assert main([str(bag), '--output', str(output)]) == 0
    check(output / 'drive_segments', [0, 1, 2, 3, 4])
    assert len(list((output / 'drive').iterdir())) == 15


@pytest.mark.parametrize('jobs', ['1', '2'])
def test_a_bag_of_raw_images_of_which_one_cannot_be_read(
        tmp_path: Path, capfd: pytest.CaptureFixture[str], jobs: str) -> None:
    bag = make_bag(tmp_path / 'drive', RAW)
    output = tmp_path / 'found'
    assert main([str(bag), '--output', str(output), '--jobs', jobs]) == 1
    said = capfd.readouterr()
    assert "drive': image 3: encoding 'unheard' is unknown" in said.err
    assert said.out.startswith('4 images, ')
    check(output / 'drive_segments', [0, 1, 2, 4])


def test_of_several_topics_one_is_read_and_named(
        tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    bag, output = tmp_path / 'drive', tmp_path / 'found'
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, number in (('/left', 0), ('/right', 2)):
            connection = writer.add_connection(topic, COMPRESSED, typestore=TYPES)
            writer.write(connection, START + 1000 + number * 50_000_000,
                         TYPES.serialize_cdr(message(number, COMPRESSED), COMPRESSED))
    assert main([str(bag), '--output', str(output / 'left')]) == 0
    assert 'reads /left, the first of its image topics /left, /right: choose by --topic' \
        in capfd.readouterr().err
    check(output / 'left' / 'drive_segments', [0])
    assert main([str(bag), '--output', str(output / 'right'), '--topic', '/right']) == 0
    assert 'topics' not in capfd.readouterr().err
    check(output / 'right' / 'drive_segments', [2])
    assert main([str(bag), '--output', str(output / 'none'), '--topic', '/up']) == 1
    assert 'topic /up is not in this bag: must be one of' in capfd.readouterr().err


def test_one_file_of_a_bag_and_an_image_beside_it(tmp_path: Path) -> None:
    file, = make_bag(tmp_path / 'drive', COMPRESSED).glob('*.mcap')
    cv2.imwrite(str(tmp_path / 'photo.png'), gray(0))
    output = tmp_path / 'found'
    assert main([str(file), str(tmp_path / 'photo.png'), '--output', str(output)]) == 0
    check(output / f'{file.stem}_segments', [0, 1, 2, 3, 4])
    assert (output / 'photo.csv').exists()


def test_a_bag_that_is_there_already_is_left_alone(
        tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    bag = make_bag(tmp_path / 'drive', COMPRESSED)
    assert main([str(bag), '--output', str(tmp_path / 'found')]) == 0
    capfd.readouterr()
    assert main([str(bag), '--output', str(tmp_path / 'found')]) == 2
    assert "drive_segments' is already there" in capfd.readouterr().err
    check(tmp_path / 'found' / 'drive_segments', [0, 1, 2, 3, 4])


def test_a_damaged_bag_is_named(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'broken.mcap').write_bytes(b'no bag')
    cv2.imwrite(str(tmp_path / 'photo.png'), gray(0))
    assert main([str(tmp_path / 'broken.mcap'), str(tmp_path / 'photo.png'),
                 '--output', str(tmp_path / 'found')]) == 1
    assert 'broken.mcap' in capfd.readouterr().err
    assert sorted(path.name for path in (tmp_path / 'found').iterdir()) == [
        'photo.csv', 'photo.json', 'photo.png']


def test_no_ros_is_needed(tmp_path: Path) -> None:
    """Run where importing rclpy or messages would fail."""
    for name in ('rclpy', 'sensor_msgs', 'std_msgs'):
        (tmp_path / 'path' / name).mkdir(parents=True)
        (tmp_path / 'path' / name / '__init__.py').write_text('raise ImportError')
    bag = make_bag(tmp_path / 'drive', COMPRESSED)
    result = subprocess.run(
        [sys.executable, '-m', 'qflsd_ros.cli.detect', str(bag), '--output',
         str(tmp_path / 'found')], capture_output=True, text=True, timeout=120,
        env=os.environ | {'PYTHONPATH': os.pathsep.join([str(tmp_path / 'path'), os.getcwd()])})
    assert result.returncode == 0, result.stderr
