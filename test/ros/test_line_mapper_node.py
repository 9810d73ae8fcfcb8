"""The example that maps lines, as a process over real DDS."""
from __future__ import annotations

import itertools
from pathlib import Path
import runpy
from typing import Any, Callable, TYPE_CHECKING

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from qflsd_ros import records
from qflsd_ros.core.pose import Pose
from qflsd_ros.ros.output import clouds
from qflsd_ros.sources import Scene
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

if TYPE_CHECKING:
    from conftest import Peer, Process

EXAMPLE = 'examples/line_mapper.py'
ROOT = Path(__file__).parents[2]
LINES = np.array([[[-1.0, -0.5, 3], [1, -0.6, 3.5]], [[0.5, -1, 2.5], [0.6, 1, 2.6]],
                  [[-0.5, 0.8, 3], [-0.4, 0.5, 4]], [[-1.0, 0.6, 2.8], [0.9, 0.7, 2.9]]])
STEP = 50_000_000   # ns between images


def header(number: float) -> Header:
    """Return the header of an image, or of a time between two images."""
    stamp = 10**9 + round(number * STEP)
    return Header(stamp=Time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id='world')


def place(number: float) -> np.ndarray:
    """Return where the camera is: it moves evenly, so that interpolation is exact."""
    return np.array([0.03, 0.02, 0.005]) * number


def planes(number: float) -> PointCloud2:
    """Return what a camera sees that looks along z."""
    rays = LINES - place(number)
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    normals = np.cross(rays[:, 0], rays[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    spread = np.eye(3) - normals[:, :, None] * normals[:, None]
    table = np.zeros(len(LINES), records.PLANE)
    for column, axis in enumerate('xyz'):
        table[f'normal_{axis}'] = normals[:, column]
        table[f'start_{axis}'], table[f'end_{axis}'] = rays[:, 0, column], rays[:, 1, column]
    for i, j, axes in zip(*np.triu_indices(3), records.COVARIANCE):
        table[f'covariance_{axes}'] = 1e-8 * spread[:, i, j]
    table['track'] = [7, 3, 12, 5]
    return clouds.cloud(header(number), table)


def pose(number: float) -> PoseStamped:
    message = PoseStamped(header=header(number))
    message.pose.position.x, message.pose.position.y, message.pose.position.z = place(number)
    return message


class Mapper:
    """The example between publishers and subscriptions of the test."""

    def __init__(self, peer: Peer, *arguments: str, pose_type: type = PoseStamped) -> None:
        self.peer = peer
        self.numbers = itertools.count()
        self.lines: list[PointCloud2] = []
        self.markers: list[MarkerArray] = []
        self.planes = peer.node.create_publisher(PointCloud2, 'planes', 100)
        self.pose = peer.node.create_publisher(pose_type, 'pose', 100)
        peer.node.create_subscription(PointCloud2, '/line_mapper/lines', self.lines.append, 10)
        peer.node.create_subscription(MarkerArray, '/line_mapper/markers', self.markers.append, 10)
        self.process: Process = peer.run(EXAMPLE, '--ros-args', '-p', 'rate:=10.0', *arguments)
        peer.until(lambda: self.planes.get_subscription_count()
                   and self.pose.get_subscription_count()
                   and peer.node.count_publishers('/line_mapper/lines'))

    def found(self, publish: Callable[[int], None]) -> np.ndarray:
        """Publish one image after the other until all four lines are there; return them."""
        self.peer.until(lambda: self.lines and self.lines[-1].width == 4,
                        lambda: publish(next(self.numbers)))
        return clouds.records(self.lines[-1])


def ends(rows: np.ndarray) -> np.ndarray:
    """Return starts and ends of lines, (N, 2, 3), in the order of LINES."""
    points = np.stack([np.stack([rows[f'{end}_{axis}'] for axis in 'xyz'], 1)
                       for end in ('start', 'end')], axis=1)
    return points[np.searchsorted(rows['track'], [7, 3, 12, 5])]


def test_planes_and_poses_of_the_same_stamps_become_lines(peer: Peer) -> None:
    mapper = Mapper(peer)

    def publish(number: int) -> None:
        mapper.planes.publish(planes(number))
        mapper.pose.publish(pose(number))
    rows = mapper.found(publish)
    assert rows.dtype == records.LINE
    assert mapper.lines[-1].header.frame_id == 'world'
    assert ends(rows) == pytest.approx(LINES, abs=1e-3)
    marker, = mapper.peer.until(lambda: mapper.markers and mapper.markers[-1]).markers
    assert marker.type == Marker.LINE_LIST and marker.header.frame_id == 'world'
    assert len(marker.points) == len(marker.colors) == 8
    assert marker.colors[0] == marker.colors[1] != marker.colors[2]


def test_odometry_of_a_body_and_poses_between_the_images(peer: Peer) -> None:
    """The camera is mounted turned about z by a quarter, .2 m beside the body's origin."""
    turn = np.sqrt(0.5)
    mapper = Mapper(peer, '-p', 'pose_type:=Odometry', '-p',
                    f'camera_in_body:=[0.2, 0.0, 0.0, 0.0, 0.0, {turn}, {turn}]',
                    pose_type=Odometry)
    back = Pose.from_quaternion(np.array([0, 0, -turn, turn]), np.zeros(3))

    def publish(number: int) -> None:
        body = place(number - 0.4) - back.rotation @ (0.2, 0, 0)
        message = Odometry(header=header(number - 0.4))
        at, facing = message.pose.pose.position, message.pose.pose.orientation
        at.x, at.y, at.z = body
        facing.z, facing.w = -turn, turn
        mapper.pose.publish(message)
        mapper.planes.publish(planes(number))
    assert ends(mapper.found(publish)) == pytest.approx(LINES, abs=1e-3)


def test_whatever_comes_the_mapper_goes_on_and_says_what_it_could_not_use(peer: Peer) -> None:
    mapper = Mapper(peer)

    def publish(number: int) -> None:
        """Leave a gap of ten images after each ten, with the planes of its middle."""
        at = number + number // 10 * 10
        if number % 10 == 0:
            broken, short = pose(at), planes(at)
            broken.pose.position.x = np.nan
            short.fields = short.fields[:-3]
            mapper.planes.publish(planes(at - 5))
            mapper.planes.publish(short)
            mapper.pose.publish(broken)
        else:
            mapper.planes.publish(planes(at))
        mapper.pose.publish(pose(at))
    mapper.found(publish)
    peer.until(lambda: all(text in mapper.process.output for text in (
        'further apart than max_gap', 'are no pose', 'not those of the detector')),
        lambda: publish(next(mapper.numbers)))


def test_camera_detector_and_mapper_map_the_room(peer: Peer) -> None:
    found: list[PointCloud2] = []
    peer.node.create_subscription(PointCloud2, '/line_mapper/lines', found.append, 10)
    peer.run(EXAMPLE, '--ros-args', '-r', 'planes:=/detector/planes')
    peer.run('-m', 'qflsd_ros.ros', 'detector')
    peer.until(lambda: peer.node.count_subscribers('/detector/planes'))
    peer.run('-m', 'qflsd_ros.ros', 'camera', '--ros-args', '-p', 'rate:=20.0')
    peer.until(lambda: found and found[-1].width >= 30)
    rows = clouds.records(found[-1])
    assert found[-1].header.frame_id == 'map'
    middles = np.stack([rows[axis] for axis in 'xyz'], axis=1)
    edges = Scene().edges
    along = edges[:, 1] - edges[:, 0]
    off = middles[:, None] - edges[:, 0]
    share = np.clip((off * along).sum(2) / (along ** 2).sum(1), 0, 1)
    distance = np.linalg.norm(off - share[..., None] * along, axis=2).min(axis=1)
    assert np.median(distance) < 0.02


SPACE = runpy.run_path(str(ROOT / EXAMPLE))


def trajectory(*stamps: float) -> Any:
    known = SPACE['Trajectory'](0.2)
    for stamp in stamps:
        known.add(SPACE['stamped'](pose(stamp)))
    return known


def at(known: Any, number: float) -> Any:
    return known.at(10**9 + round(number * STEP))


def test_between_two_poses_one_is_interpolated() -> None:
    known = trajectory(0, 1, 3)
    assert at(known, 1).centre == pytest.approx(place(1))
    assert at(known, 1.5).centre == pytest.approx(place(1.5))


def test_there_is_no_pose_before_the_first_after_the_last_and_in_a_gap() -> None:
    known = trajectory(0, 1, 6)
    assert at(known, -1) is None and at(known, 7) is None and at(known, 3) is None
    assert at(known, 6).centre == pytest.approx(place(6))


def test_stamps_that_go_back_begin_a_new_trajectory() -> None:
    known = trajectory(50, 51, 0, 1)
    assert at(known, 0.5) is not None and at(known, 50) is None
