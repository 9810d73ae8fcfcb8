"""The command ``detect`` writes of a bag exactly what the node publishes of it."""
from __future__ import annotations

from pathlib import Path
from typing import Any, TYPE_CHECKING

import cv2
import numpy as np
import pytest
from qflsd_ros.cli.detect import main
from qflsd_ros.sources import Scene
from rclpy.serialization import deserialize_message, serialize_message
from rig import image, Rig
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores
from sensor_msgs.msg import CompressedImage, Image, PointCloud2

if TYPE_CHECKING:
    from conftest import Peer

TYPES = get_typestore(Stores.ROS2_JAZZY)
PARAMETERS = """\
/**:
  ros__parameters: {polyline_tolerance: 0.4, min_length: 12, roi_x: 40, white_level: 1023.0}
/detector:
  ros__parameters: {min_length: 10.0, max_width: 320}
/other/detector:
  ros__parameters: {min_length: 100.0}
"""


def frames(kind: type, count: int = 8) -> list[Any]:
    """Return the messages of a camera, from which the lens can be estimated."""
    room = Scene(480, 360, lam=-0.5)
    found = []
    for number in range(count):
        gray = room.image(30 * number)
        if kind is Image:
            found.append(image(gray.astype('<u2') * 4, 'mono16'))
        else:
            data = cv2.imencode('.jpg', np.dstack([gray, gray // 2, 255 - gray]))[1]
            found.append(CompressedImage(format='jpeg', data=data.tobytes()))
            found[-1].header.stamp.sec = 1 + number
    return found


def record(path: Path, kind: str, messages: list[Any]) -> None:
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/image', kind, typestore=TYPES)
        for number, message in enumerate(messages):
            writer.write(connection, number, serialize_message(message))


def published(rig: Rig, message: Any) -> PointCloud2:
    """Publish a frame once, because the next result depends on it; again if it was lost."""
    for _ in range(3):
        rig.publish(message)
        try:
            return rig.peer.until(lambda: next(
                (answer for answer in rig.received['segments']
                 if answer.header == message.header), None), timeout=15)
        except AssertionError:
            continue
    raise AssertionError('no result')


@pytest.mark.parametrize('kind', [Image, CompressedImage])
def test_a_bag_has_what_the_node_publishes(peer: Peer, tmp_path: Path, kind: type) -> None:
    """Both agree byte for byte, with the estimated lens and with parameters of all kinds."""
    raw = kind is Image
    parameters = tmp_path / 'p.yaml'
    parameters.write_text(PARAMETERS)
    messages = frames(kind)
    record(tmp_path / 'drive', f'sensor_msgs/msg/{kind.__name__}', messages)
    assert main([str(tmp_path / 'drive'), '--params', str(parameters),
                 '--jobs', '2' if raw else '1', '--output', str(tmp_path / 'out')]) == 0

    rig = Rig(peer, '--params-file', str(parameters), '-p',
              f'image_transport:={"raw" if raw else "compressed"}', lens='estimate',
              tracking=True,
              topic='/image' if raw else '/image/compressed', camera_type=kind).ready()
    wanted = [published(rig, message) for message in messages]
    assert float(rig_lambda(rig)) == pytest.approx(-0.5, abs=0.1)
    with Reader(tmp_path / 'out' / 'drive_segments') as reader:
        found = [deserialize_message(bytes(data), PointCloud2)
                 for _, _, data in reader.messages()]
    assert len(found) == len(wanted) and min(cloud.width for cloud in found) > 50
    for one, other in zip(found, wanted):
        assert one == other and bytes(one.data) == bytes(other.data)


def rig_lambda(rig: Rig) -> str:
    """Return the lambda that the node has estimated, which proves that there is a lens."""
    return next(value.value for value in rig.report('lens lambda').values
                if value.key == 'lens lambda')


def test_a_file_for_another_node_is_warned_of(peer: Peer, tmp_path: Path) -> None:
    path = tmp_path / 'p.yaml'
    path.write_text('detektor:\n  ros__parameters: {min_length: 30.0}\n')
    rig = Rig(peer, '--params-file', str(path)).ready()
    peer.until(lambda: f'{path}: no section matches the node /detector' in rig.process.output)
    assert 'all of it is ignored: it has /detektor' in rig.process.output
