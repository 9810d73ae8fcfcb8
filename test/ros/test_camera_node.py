"""The camera as a process over real DDS."""
from __future__ import annotations

import json
import os
from pathlib import Path
import signal
import time
from typing import Any, TYPE_CHECKING

import cv2
from geometry_msgs.msg import PoseStamped
import numpy as np
import pytest
from qflsd_ros.ros.camera import CameraSettings, main
from qflsd_ros.ros.output.camera_info import camera_model
from qflsd_ros.ros.parameters.declaration import yaml_text
from qflsd_ros.sources import Scene
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores
from sensor_msgs.msg import CameraInfo, Image

if TYPE_CHECKING:
    from conftest import Peer, Process

ROOT = Path(__file__).parents[2]
START = 1_600_000_000_123_456_789
BEST_EFFORT, RELIABLE = ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE
# s after the first image.  Until both ends know of each other, a volatile subscription may miss
# images: for 0.2 s on a busy machine.
DISCOVERY = 1.0


def start(peer: Peer, *parameters: str, **environment: str) -> Process:
    arguments = [part for parameter in parameters for part in ('-p', parameter)]
    return peer.run('-m', 'qflsd_ros.ros', 'camera', '--ros-args', *arguments, **environment)


def discovered(peer: Peer, images: list[Any]) -> None:
    """Spin until DDS discovery has settled, and forget the images that came meanwhile."""
    peer.until(lambda: images)
    end = time.monotonic() + DISCOVERY
    peer.until(lambda: time.monotonic() > end)
    images.clear()


def receive(peer: Peer, count: int, reliability: ReliabilityPolicy = BEST_EFFORT,
            depth: int = 1, connected: bool = False) -> list[Image]:
    """Return the next images, or, if ``connected``, those that follow after discovery."""
    images: list[Image] = []
    subscription = peer.node.create_subscription(
        Image, 'image', images.append, QoSProfile(depth=depth, reliability=reliability))
    if connected:
        discovered(peer, images)
    peer.until(lambda: len(images) >= count)
    peer.node.destroy_subscription(subscription)
    return images


def stamp(image: Image) -> int:
    return image.header.stamp.sec * 10**9 + image.header.stamp.nanosec


def write_bag(path: Path, storage: StoragePlugin, count: int) -> str:
    types = get_typestore(Stores.ROS2_JAZZY)
    kind = 'sensor_msgs/msg/Image'
    with Writer(path, version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection('/cam/image_raw', kind, typestore=types)
        for number in range(count):
            time = types.types['builtin_interfaces/msg/Time'](
                (START + number) // 10**9, (START + number) % 10**9)
            header = types.types['std_msgs/msg/Header'](time, 'recorded')
            image = types.types[kind](header, 4, 5, '16UC1', 1, 12,
                                      np.full(48, number, np.uint8))
            writer.write(connection, START + number * 20_000_000, types.serialize_cdr(image, kind))
    return str(path)


def test_yaml_lists_every_parameter_with_its_default():
    text = yaml_text((CameraSettings,)).replace('detector', 'camera')
    assert (ROOT / 'config' / 'camera.yaml').read_text() == text


@pytest.mark.alone
@pytest.mark.parametrize('reliability', [BEST_EFFORT, RELIABLE])
def test_scene_at_its_rate_for_both_kinds_of_subscription(peer, reliability):
    """Once it is connected, a subscription misses no frame."""
    camera = start(peer, 'rate:=20.0', 'width:=160', 'height:=120', 'seed:=3', 'frame_id:=eye')
    # Ten images, since this process may be late by half a second, for both kinds alike.
    images = receive(peer, 40, reliability, depth=10, connected=True)
    age = peer.node.get_clock().now().nanoseconds - stamp(images[-1])
    assert 0 <= age < 1e9
    scene = Scene(160, 120, seed=3)
    frames = [scene.image(number).tobytes() for number in range(400)]
    numbers = [frames.index(bytes(image.data)) for image in images]
    assert np.diff(numbers).tolist() == [1] * (len(images) - 1)
    assert np.median(np.diff([stamp(image) for image in images])) == pytest.approx(5e7, rel=0.1)
    image = images[0]
    assert (image.height, image.width, image.step, image.encoding) == (120, 160, 160, 'mono8')
    assert image.header.frame_id == 'eye'
    assert camera.stop() == 0
    assert 'Traceback' not in camera.output


def cpu_time(process: Process) -> float:
    """Return the CPU time of a process, s."""
    fields = Path(f'/proc/{process.popen.pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


@pytest.mark.alone
def test_scene_stands_still_while_nobody_looks(peer):
    """Without a subscriber it uses no CPU; later it resumes at its rate, with new stamps."""
    camera = start(peer, 'rate:=30.0', 'width:=320', 'height:=240')
    scene = Scene(320, 240)
    frames = [scene.image(number).tobytes() for number in range(400)]
    last = frames.index(bytes(receive(peer, 10)[-1].data))
    peer.until(lambda: not peer.node.count_subscribers('/image'))
    worked, begin = cpu_time(camera), time.monotonic()
    peer.until(lambda: time.monotonic() > begin + 5.0)
    assert cpu_time(camera) - worked < 0.05 * (time.monotonic() - begin)
    images = receive(peer, 30, RELIABLE, depth=10)
    numbers = [frames.index(bytes(image.data)) for image in images]
    assert last < numbers[0] < last + 30
    stamps = [stamp(image) for image in images]
    assert 0 <= peer.node.get_clock().now().nanoseconds - stamps[0] < 2e9
    assert np.median(np.diff(stamps)) == pytest.approx(1e9 / 30, rel=0.1)
    assert min(np.diff(stamps)) > 0.2e9 / 30
    assert 'cannot keep its rate' not in camera.output


def test_scene_in_colour(peer):
    start(peer, 'encoding:=bgr8', 'width:=80', 'height:=60', 'noise:=0.0', 'lam:=-0.2')
    image = receive(peer, 1)[0]
    assert (image.step, image.encoding) == (240, 'bgr8')
    pixels = np.frombuffer(image.data, np.uint8).reshape(60, 80, 3).astype(int)
    assert np.ptp(pixels, axis=2).max() > 30


@pytest.mark.parametrize('storage', list(StoragePlugin))
def test_bag_keeps_its_messages_and_loops(peer, tmp_path, storage):
    bag = write_bag(tmp_path / 'bag', storage, 6)
    start(peer, f'source:={bag}', 'frame_id:=ignored', 'encoding:=bgr8', 'rate:=10.0')
    images = receive(peer, 14, RELIABLE, depth=10, connected=True)
    numbers = [stamp(image) - START for image in images]
    assert all(after == (before + 1) % 6 for before, after in zip(numbers, numbers[1:]))
    for number, image in zip(numbers, images):
        assert bytes(image.data) == bytes([number]) * 48
        assert (image.height, image.width, image.step) == (4, 5, 12)
        assert (image.encoding, image.is_bigendian) == ('16UC1', 1)
        assert image.header.frame_id == 'recorded'


@pytest.mark.alone
def test_bag_is_played_at_its_own_pace_times_speed(peer, tmp_path):
    bag = write_bag(tmp_path / 'bag', StoragePlugin.MCAP, 200)
    start(peer, f'source:={bag}', 'speed:=0.5')
    times: list[int] = []
    peer.node.create_subscription(
        Image, 'image', lambda _: times.append(peer.node.get_clock().now().nanoseconds), 10)
    peer.until(lambda: len(times) >= 30)
    assert np.median(np.diff(times)) == pytest.approx(4e7, rel=0.15)


def test_folder_that_does_not_loop_ends_the_node(peer, tmp_path):
    for number in range(200):
        cv2.imwrite(str(tmp_path / f'{number}.png'), np.full((6, 8), number, np.uint8))
    (tmp_path / '50.png').write_bytes(b'damaged')
    images: list[Image] = []
    peer.node.create_subscription(Image, 'image', images.append, 10)
    camera = start(peer, f'source:={tmp_path}', 'loop:=false', 'rate:=25.0')
    discovered(peer, images)
    peer.until(lambda: camera.popen.poll() is not None)
    assert camera.wait() == 0
    assert camera.output.count('50.png') == 1 and 'Traceback' not in camera.output
    peer.until(lambda: images and images[-1].data[0] == 199)
    numbers = [image.data[0] for image in images]
    assert numbers == [number for number in range(numbers[0], 200) if number != 50]
    assert {image.encoding for image in images} == {'mono8'}


@pytest.mark.parametrize(('parameter', 'what'), [
    ('source:=/no/such/place', "camera: '/no/such/place' is not there: must be an image"),
    ('source:=/dev/null', "'/dev/null' is not there"),
    ('source:="63"', 'camera: webcam 63: cannot be opened'),
    ('source:="200"', 'camera: webcam 200: its number must lie in 0 to 99'),
    ('source:="99999999999"', 'camera: webcam 99999999999: its number must lie in 0 to 99'),
    ('rate:=0.0', 'camera: parameter rate is 0.0: must lie in 0.01 to 1000.0 Hz'),
    ('encoding:=rgb8', 'camera: parameter encoding is '),
    ('width:=wide', 'camera: parameter width is '),
    ('lam:=-2.0', 'camera: parameter lam is -2.0: must lie in -1.0 to 0.5')])
def test_what_cannot_be_used_is_one_line_and_exit_code_2(refuse, parameter, what):
    """Also as a process, see test_run_node.py."""
    assert what in refuse(main, '-p', parameter)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_with_exit_code_0(peer, number):
    camera = start(peer, 'width:=64', 'height:=48', 'rate:=100.0')
    receive(peer, 3)
    assert camera.stop(number) == 0
    assert 'Traceback' not in camera.output


@pytest.mark.alone
def test_nothing_is_lost_by_a_best_effort_subscription_of_depth_1(peer):
    """Images of 300 KB at 30 Hz, with the profile that enlarges the shared memory."""
    profile = {'FASTRTPS_DEFAULT_PROFILES_FILE': str(ROOT / 'config' / 'fastdds.xml')}
    path = peer.folder / 'flat.png'
    cv2.imwrite(str(path), np.zeros((480, 640), np.uint8))
    numbers: list[int] = []
    peer.node.create_subscription(
        Image, 'image', lambda _, info: numbers.append(info['publication_sequence_number']),
        QoSProfile(depth=1, reliability=BEST_EFFORT))
    start(peer, f'source:={path}', 'rate:=30.0', **profile)
    discovered(peer, numbers)
    peer.until(lambda: len(numbers) >= 150)
    # On a busy machine this process may come too late for one now and then.
    assert numbers[-1] - numbers[0] + 1 - len(numbers) <= 3


def together(peer: Peer, prefix: str, count: int) -> list[tuple[Image, CameraInfo, PoseStamped]]:
    """Return images with the calibration and the pose of the same stamp."""
    received: dict[str, dict[int, Any]] = {'image': {}, 'camera_info': {}, 'pose': {}}

    def take(topic: str) -> Any:
        return lambda message: received[topic].__setitem__(stamp(message), message)
    for topic, kind in (('image', Image), ('camera_info', CameraInfo), ('pose', PoseStamped)):
        name = topic if topic == 'pose' else prefix + topic
        peer.node.create_subscription(kind, name, take(topic), 10)

    def common() -> list[int]:
        return sorted(set.intersection(*map(set, received.values())))
    peer.until(lambda: len(common()) >= count)
    return [(received['image'][key], received['camera_info'][key], received['pose'][key])
            for key in common()]


def matrix(message: PoseStamped) -> np.ndarray:
    """Return the (4, 4) matrix of a pose."""
    q, p = message.pose.orientation, message.pose.position
    x, y, z, w = q.x, q.y, q.z, q.w
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = turn, (p.x, p.y, p.z)
    return result


def test_scene_publishes_its_calibration_and_its_true_pose(peer):
    start(peer, 'width:=160', 'height:=120', 'lam:=-0.4', 'frame_id:=eye')
    scene = Scene(160, 120, lam=-0.4)
    frames = [scene.image(number).tobytes() for number in range(200)]
    grid = np.stack(np.meshgrid([0.0, 80, 159], [0.0, 60, 119]), -1).reshape(-1, 2)
    for image, info, pose in together(peer, '', 5):
        assert info.header == image.header and image.header.frame_id == 'eye'
        assert pose.header.stamp == image.header.stamp and pose.header.frame_id == 'map'
        number = frames.index(bytes(image.data))
        assert matrix(pose) == pytest.approx(scene.pose(number), abs=1e-9)
        rays = camera_model(info, '/camera_info', 120, 160).rays(grid)
        wanted = scene._camera(number).rays(grid) @ scene._camera(number).axes.T
        wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
        assert np.abs(rays - wanted).max() < 0.1 / 90


def test_sequence_is_published_with_stamps_poses_and_calibration(peer, tmp_path):
    poses = []
    for number in range(40):
        turn = np.eye(4)
        turn[:3, :3] = cv2.Rodrigues(np.array([0.1 * number, 3.0, 0.02 * number]))[0]
        turn[:3, 3] = number, 2, -1
        poses.append(turn)
        cv2.imwrite(str(tmp_path / f'{number}.png'), np.full((6, 8), number, np.uint8))
    content = {'K': [[20.0, 0, 4], [0, 21, 3], [0, 0, 1]], 'distortion': [0.1, -0.2],
               'frames': [{'image': f'{number}.png', 'stamp': 100 + 0.05 * number,
                           'pose': pose.tolist()} for number, pose in enumerate(poses)]}
    (tmp_path / 'sequence.json').write_text(json.dumps(content))
    # The calibration stays beside the image, where the detector looks for it.
    peer.run('-m', 'qflsd_ros.ros', 'camera', '--ros-args', '-r', 'image:=/cam/image',
             '-p', f'source:={tmp_path}')
    for image, info, pose in together(peer, '/cam/', 8):
        number = image.data[0]
        assert stamp(image) == 100 * 10**9 + 50_000_000 * number
        assert info.header == image.header and (info.width, info.height) == (8, 6)
        assert info.distortion_model == 'plumb_bob' and info.d.tolist() == [0.1, -0.2, 0, 0, 0]
        assert info.k.tolist() == [20, 0, 4, 0, 21, 3, 0, 0, 1]
        assert matrix(pose) == pytest.approx(poses[number], abs=1e-9)


def test_a_source_without_calibration_has_no_such_topics(peer, tmp_path):
    cv2.imwrite(str(tmp_path / 'a.png'), np.zeros((6, 8), np.uint8))
    start(peer, f'source:={tmp_path}')
    receive(peer, 2)
    topics = {name for name, _ in peer.node.get_publisher_names_and_types_by_node('camera', '/')}
    assert '/image' in topics and not topics & {'/camera_info', '/pose'}
