"""Attitude, focal length and the check of a calibration by the detector over real DDS."""
from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import pytest
from qflsd_ros.core import compilation, DivisionModel
from qflsd_ros.core.attitude import tracker as attitude_tracker
from qflsd_ros.core.lens.conversion import camera_info_terms
from qflsd_ros.ros.output import clouds
from qflsd_ros.sources import Scene
from qflsd_ros.sources.scene.optics import FOCAL
from rclpy.qos import qos_profile_sensor_data
from rig import BLACK, image, Rig, values
from sensor_msgs.msg import CameraInfo

if TYPE_CHECKING:
    from conftest import Peer

ROOM = Scene(640, 480, -0.6, 2.0)
TRUE_FOCAL = FOCAL * ROOM.lens.half_diagonal


def rotated(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return a vector rotated by a unit quaternion x, y, z, w."""
    axis, w = quaternion[:3], quaternion[3]
    return vector + 2 * np.cross(axis, np.cross(axis, vector) + w * vector)


def test_attitude_and_focal_length(peer: Peer) -> None:
    rig = Rig(peer, '-p', 'attitude:=on', '-p', 'focal:=estimate', lens='estimate',
              listen=('arcs', 'attitude', 'gravity', 'camera_info')).ready()
    for number in range(0, 60, 4):
        picture = image(ROOM.image(number))
        imu = rig.detect(picture, 'attitude')
    down = ROOM._camera(56).axes @ [0, 0, -1]
    found = rig.detect(picture, 'gravity').vector
    assert np.array([found.x, found.y, found.z]) @ down > np.cos(np.radians(0.5))
    q = imu.orientation
    world = rotated(np.array([q.x, q.y, q.z, q.w]), down)
    assert world[2] < -np.cos(np.radians(0.5))
    assert 0 < imu.orientation_covariance[0] < 0.01 < 1e3 < imu.orientation_covariance[8]
    assert imu.angular_velocity_covariance[0] == imu.linear_acceleration_covariance[0] == -1
    info = rig.detect(picture, 'camera_info')
    assert info.k[0] == pytest.approx(TRUE_FOCAL, rel=0.02)
    labels = clouds.records(rig.detect(picture, 'arcs'))['direction']
    assert all(np.count_nonzero(labels == axis) > 10 for axis in range(3))
    assert 'focal length deviation (px)' in values(rig.report('focal length (px)'))
    rig.show(image(BLACK), 'no attitude: ')
    refused = rig.change(attitude=False)[0]
    assert not refused.successful and 'both by set_parameters_atomically' in refused.reason
    assert all(result.successful for result in rig.change(focal='off', attitude=False))
    rig.show(picture, 'no attitude: parameter attitude is false')


@pytest.mark.slow
def test_attitude_that_is_switched_on_compiles_beside_detection(peer: Peer) -> None:
    """Images keep their results meanwhile; the reason for the missing attitude is logged."""
    attitude_tracker.warm_up()
    cache = peer.folder / 'cache'
    shutil.copytree(compilation.STORE.folder.parent, cache / 'qflsd_ros')
    # All of them, since one alone is compiled before the next image arrives.
    for kernel in compilation._kernels:
        if kernel.module.startswith('qflsd_ros.core.attitude'):
            for path in cache.rglob(f'{kernel.py_func.__name__}-*.*'):
                path.unlink()
    rig = Rig(peer, lens='estimate', listen=('arcs', 'attitude'),
              NUMBA_CACHE_DIR=str(cache)).ready()
    rig.detect(image(ROOM.image(0)), 'arcs')
    assert rig.change(attitude=True)[0].successful
    rig.show(image(ROOM.image(0)), 'no attitude: its kernels are still being loaded')
    rig.detect(image(ROOM.image(0)), 'arcs')
    rig.detect(image(ROOM.image(0)), 'attitude')


def calibration(**changes: object) -> CameraInfo:
    terms = camera_info_terms(ROOM.lens, TRUE_FOCAL)
    message = CameraInfo(height=480, width=640, distortion_model=terms.distortion_model,
                         d=terms.coefficients, k=terms.matrix.ravel())
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def test_a_calibration_is_watched(peer: Peer) -> None:
    rig = Rig(peer, '-p', 'attitude:=on', lens='estimate').ready()
    info = peer.node.create_publisher(CameraInfo, '/camera_info', qos_profile_sensor_data)
    images = [ROOM.image(number) for number in range(0, 60, 4)]
    wrong = camera_info_terms(DivisionModel(-0.4, (480, 640)), TRUE_FOCAL)
    for changes, level, text in (
            ({}, DiagnosticStatus.OK, 'makes straight edges straight'),
            ({'d': wrong.coefficients}, DiagnosticStatus.WARN, 'straight edges stay bent by'),
            ({'width': 320}, DiagnosticStatus.WARN, 'describes images of 320 x 480')):
        rig.reports.clear()

        def publish(changes: dict[str, object] = changes) -> None:
            info.publish(calibration(**changes))
            rig.publish(image(images[rig.published % len(images)]))
        found = peer.until(lambda: next(
            (status for status in rig.reports if status.name.endswith('calibration')
             and text in status.message), None), publish)
        assert found.level == level
