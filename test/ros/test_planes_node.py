"""Planes from camera_info, published by the detector as a process over real DDS."""
from __future__ import annotations

from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import pytest
from qflsd_ros.ros.output import clouds
from rclpy.qos import qos_profile_sensor_data
from rig import EXPECTED, image, Rig, same, SCENE
from sensor_msgs.msg import CameraInfo

if TYPE_CHECKING:
    from conftest import Peer


def camera_info(**changes: object) -> CameraInfo:
    message = CameraInfo(height=240, width=320, distortion_model='plumb_bob',
                         d=[0.0] * 5, k=[200.0, 0, 160, 0, 200, 120, 0, 0, 1])
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def test_planes_hold_the_lines(peer: Peer) -> None:
    """For a lens without distortion, every straight edge lies in its plane."""
    rig = Rig(peer, '-r', 'image:=/cam/image_raw', topic='/cam/image_raw',
              listen=('segments', 'planes')).ready()
    info = peer.node.create_publisher(CameraInfo, '/cam/camera_info', qos_profile_sensor_data)
    rig.show(image(SCENE), 'no camera_info has been received on /cam/camera_info')
    # Everything else goes on without it.
    assert same(rig.detect(image(SCENE)), EXPECTED)
    assert rig.report('no camera_info').level == DiagnosticStatus.WARN
    for changes, text in (
            ({'width': 640}, 'describes images of 640 x 240 pixels: must describe images of '
             '320 x 240'),
            ({'distortion_model': 'fov'}, "distortion model is 'fov': must be one of plumb_bob"),
            ({'k': [0.0] * 9}, 'the camera is not calibrated')):
        peer.until(lambda: text in rig.process.output, lambda: (
            info.publish(camera_info(**changes)), rig.camera.publish(image(SCENE))))
    message = image(SCENE)
    peer.until(lambda: any(planes.header == message.header for planes in rig.received['planes']),
               lambda: (info.publish(camera_info()), rig.camera.publish(message)))
    rows = clouds.records(rig.received['planes'][-1])
    assert rows.dtype == clouds.PLANE
    assert rows['segment'].tolist() == list(range(len(EXPECTED)))
    normals = np.stack([rows[f'normal_{axis}'] for axis in 'xyz'], 1)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1, abs=1e-6)
    straight = [i for i, line in enumerate(EXPECTED) if len(line) == 2]
    assert len(straight) >= 3
    for i in straight:
        rays = np.c_[(EXPECTED[i] - (160, 120)) / 200, [1, 1]]
        assert np.abs(rays @ normals[i]).max() < 0.12 / 200  # px, the tolerance of the polylines
        assert rows['covariance_xx'][i] > 0


@pytest.mark.parametrize('output', ['planes', 'line_features'])
def test_camera_info_is_left_alone_while_nobody_needs_it(peer: Peer, output: str) -> None:
    rig = Rig(peer).ready()
    # At its start the detector subscribes for a moment, to check the quality of service.
    peer.until(lambda: peer.node.count_subscribers('/camera_info') == 0)
    listener = rig.listen(output)
    peer.until(lambda: peer.node.count_subscribers('/camera_info') == 1)
    peer.node.destroy_subscription(listener)
    peer.until(lambda: peer.node.count_subscribers('/camera_info') == 0)
