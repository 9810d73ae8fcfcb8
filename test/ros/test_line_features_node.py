"""Lines for SLAM systems, published by the detector as a process over real DDS."""
from __future__ import annotations

from typing import Any, Iterator, TYPE_CHECKING

import numpy as np
import pytest
from qflsd_ros.ros.output import camera_info as infos
from qflsd_ros.sources import Scene, SceneFrames
from rclpy.qos import QoSProfile
from rig import header, image, Rig
from sensor_msgs.msg import CameraInfo, Image, PointCloud
from std_msgs.msg import Header

if TYPE_CHECKING:
    from conftest import Peer

ROOM = Scene(480, 360, lam=-0.4)
CAMERA = SceneFrames(ROOM).camera
BLACK = np.zeros((360, 480), np.uint8)
K = [300.0, 0, 240, 0, 300, 180, 0, 0, 1]


@pytest.fixture(scope='module')
def rig(module_peer: Peer) -> Iterator[Rig]:
    """Give one detector with tracks at every image, shared by the tests of this module."""
    rig = Rig(module_peer, '-p', 'line_features_rate:=0.0',
              listen=('arcs', 'line_features'), tracking=True).ready()
    rig.info = module_peer.node.create_publisher(CameraInfo, '/camera_info', QoSProfile(depth=1))
    calibrate(rig)
    yield rig


def calibrate(rig: Rig, info: CameraInfo | None = None) -> None:
    """Publish a camera_info until lines show that it has arrived."""
    info = info or infos.calibrated(Header(), CAMERA, 360, 480)
    message = image(ROOM.image(0))
    rig.peer.until(lambda: any(answer.header == message.header
                               for answer in rig.received['line_features']),
                   lambda: (rig.info.publish(info), rig.publish(message)))


def features(rig: Rig, message: Image) -> PointCloud:
    return rig.detect(message, 'line_features')


def ids(message: PointCloud) -> list[int]:
    return [int(value + 0.5) for value in message.channels[0].values]


def show(rig: Rig, rate: float, stamps: list[float]) -> list[PointCloud]:
    """Publish frames of some stamps, one after the other; return the messages at a rate."""
    assert rig.change(line_features_rate=rate)[0].successful
    shown = []
    for number, stamp in enumerate(stamps):
        message = image(ROOM.image(number))
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(
            round(stamp * 1e9), 10**9)
        message.header.frame_id = f'frame {number}'
        rig.publish(message)    # once: an image that comes twice passes twice
        rig.peer.until(lambda wanted=message.header: any(
            answer.header == wanted for answer in rig.received['arcs']))
        shown.append(message.header)
    rig.change(line_features_rate=0.0)
    features(rig, image(BLACK))     # the others precede it
    return [answer for answer in rig.received['line_features'] if answer.header in shown]


def test_lines_of_successive_frames_have_the_tracks_of_the_arcs(rig: Rig) -> None:
    numbers: dict[int, int] = {}
    for number in range(10, 16):
        message = image(ROOM.image(number))
        lines = features(rig, message)
        arcs = rig.peer.until(lambda: next((answer for answer in rig.received['arcs']
                                            if header(answer) == message.header), None))
        assert 20 < len(lines.points) <= 70 and arcs.width >= len(lines.points)
        assert len(set(ids(lines))) == len(lines.points)
        for line, track in zip(ids(lines), lines.channels[5].values):
            assert numbers.setdefault(line, int(track)) == int(track)


def test_an_image_without_arcs_gives_an_empty_message(rig: Rig) -> None:
    message = features(rig, image(BLACK))
    assert len(message.points) == 0 and len(message.channels) == 6
    assert message.header.frame_id == 'camera_optical'


def test_parameters_while_it_runs(rig: Rig) -> None:
    assert all(result.successful for result in rig.change(
        line_features_max=5, cameras=2, camera_index=1))
    message = features(rig, image(ROOM.image(20)))
    assert len(message.points) == 5 and {number % 2 for number in ids(message)} == {1}
    assert rig.change(line_features_max=70, line_features_min_length=250.0)[0].successful
    message = features(rig, image(ROOM.image(21)))
    assert 0 <= len(message.points) < 15
    refused, = rig.change(camera_index=2)
    assert not refused.successful
    assert 'camera_index is 2 and cameras is 2: camera_index must be below' in refused.reason
    # Together, since each alone contradicts the other.
    rig.change(camera_index=0)
    rig.change(cameras=1, line_features_min_length=30.0)
    assert len(features(rig, image(ROOM.image(22))).points) > 30


def test_every_third_image_of_30_at_10_hz(rig: Rig) -> None:
    found = show(rig, 10.0, [5000 + number / 30 for number in range(12)])
    assert [int(message.header.frame_id.split()[1]) for message in found] == [0, 3, 6, 9]
    # Stamps that stand still or go back never silence the topic.
    assert len(show(rig, 10.0, [6000.0] * 3)) == 3
    assert len(show(rig, 10.0, [100.0, 100.1, 100.2])) == 3


def test_without_tracks_there_are_none_and_the_reason_is_said(rig: Rig) -> None:
    assert rig.change(tracking=False)[0].successful
    rig.show(image(ROOM.image(30)), 'no tracks: parameter tracking is false')
    assert rig.report('no tracks')
    assert rig.detect(image(ROOM.image(30)), 'arcs').width > 20
    assert rig.change(tracking=True)[0].successful
    assert len(features(rig, image(ROOM.image(31))).points) > 20


@pytest.mark.parametrize(('info', 'text'), [
    (CameraInfo(height=360, width=640, distortion_model='plumb_bob', d=[0.0] * 5, k=K),
     'describes images of 640 x 360 pixels: must describe images of 480 x 360'),
    (CameraInfo(height=360, width=480, distortion_model='plumb_bob', d=[0.0] * 5,
                k=[float('nan'), *K[1:]]), 'not finite: the camera is not calibrated'),
    (CameraInfo(height=360, width=480, distortion_model='fov', k=K), "'fov': must be one of"),
    (CameraInfo(height=360, width=480, distortion_model='plumb_bob', d=[1e308] * 5, k=K), '')])
def test_a_calibration_of_no_use(rig: Rig, info: CameraInfo, text: str) -> None:
    """The reason is logged, and the next calibration is taken."""
    def said() -> bool:
        return text in rig.process.output
    before = len(rig.process.output)
    for _ in range(3):
        rig.info.publish(info)
        rig.detect(image(ROOM.image(40)), 'arcs')
    rig.peer.until(said, lambda: (rig.info.publish(info), rig.publish(image(ROOM.image(40)))))
    assert 'Traceback' not in rig.process.output[before:]
    calibrate(rig)


def test_no_camera_info_is_said(peer: Peer) -> None:
    rig = Rig(peer, listen=('arcs', 'line_features'), tracking=True).ready()
    rig.show(image(ROOM.image(0)), 'no camera_info has been received on /camera_info')
    assert not rig.received['line_features']
    assert rig.report('no camera_info')


def test_lines_lie_on_the_edges_that_the_camera_sees(rig: Rig) -> None:
    """From camera_info over DDS to lines in space: the ends are those of the true room."""
    message = features(rig, image(ROOM.image(50)))
    pose, true = ROOM.pose(50), ROOM._edge_ends
    true = (true - pose[:3, 3]) @ pose[:3, :3]
    normals = np.cross(true[:, 0], true[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    starts = np.array([(point.x, point.y, 1) for point in message.points])
    ends = np.c_[message.channels[1].values, message.channels[2].values, np.ones(len(starts))]
    rays: Any = np.stack([starts, ends])
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    off = np.abs(rays @ normals.T).max(axis=0).min(axis=1) * CAMERA.matrix[0, 0]
    assert np.median(off) < 0.3
