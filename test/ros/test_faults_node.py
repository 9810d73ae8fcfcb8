"""Faults around the detector, over real DDS: it recovers from each, and counts lost frames."""
from __future__ import annotations

import itertools
import signal
from typing import Any, Callable, Iterator, TYPE_CHECKING

import cv2
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import pytest
from qflsd_ros.core import Detector, Parameters
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter as RosParameter
from rclpy.serialization import serialize_message
from rig import EXPECTED, image, Rig, same, SCENE, values

if TYPE_CHECKING:
    from conftest import Peer

CAMERA = ('-m', 'qflsd_ros.ros', 'camera', '--ros-args', '-p', 'width:=160', '-p', 'height:=120')
UNANSWERED = 8  # requests at a time: a service keeps ten, and drops the oldest of more
WITHOUT_OVERLAY = """
import sys
from qflsd_ros.ros import detector
from qflsd_ros.ros.output import clouds
def fail(*_):
    raise ZeroDivisionError('no overlay')
clouds.overlay_image = fail
sys.exit(detector.main())
"""
WAYS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    'mono8': lambda gray: gray,
    'rgb8': lambda gray: np.dstack([gray] * 3),
    'mono16': lambda gray: gray * np.uint16(257),
    'bgra8': lambda gray: np.dstack([gray] * 4),
    'yuyv': lambda gray: np.dstack([gray, 255 - gray]),
    '32FC1': lambda gray: gray / np.float32(255)}


@pytest.fixture(scope='module')
def rig(module_peer: Peer) -> Iterator[Rig]:
    """Give one detector, shared by the tests of this module, so that their faults add up."""
    yield Rig(module_peer).ready()


@pytest.fixture(autouse=True)
def right_afterwards(request: pytest.FixtureRequest) -> Iterator[None]:
    """Check after every fault that the shared detector still works."""
    yield
    if 'rig' in request.fixturenames:
        rig: Rig = request.getfixturevalue('rig')
        assert same(rig.detect(image(SCENE)), EXPECTED)
        assert rig.process.popen.poll() is None
        assert 'Traceback' not in rig.process.output


def account(rig: Rig) -> None:
    """Return when every frame is counted; a gap at the end shows only with a further frame."""
    rig.peer.until(rig.accounted, lambda: rig.publish(image(SCENE)), period=0.5)


def test_frames_that_change_size_and_encoding_from_one_to_the_next(rig: Rig) -> None:
    rig.settle()
    grays = {size: cv2.resize(SCENE, size[::-1], interpolation=cv2.INTER_NEAREST)
             for size in ((240, 320), (1, 7), (96, 200), (480, 31))}
    expected = {size: Detector().detect(gray).polylines(0.1) for size, gray in grays.items()}
    kinds = list(itertools.product(grays, WAYS))
    for number in range(48):
        size, encoding = kinds[number * 7 % len(kinds)]  # 7: neighbours differ in both
        message = image(WAYS[encoding](grays[size]), encoding)
        assert same(rig.detect(message), expected[size]), (size, encoding)
    account(rig)


def test_a_storm_of_parameters(rig: Rig) -> None:
    """Each of 200 changes is answered, and the last one applies; all frames are counted."""
    rig.settle()
    client = rig.peer.node.create_client(SetParameters, '/detector/set_parameters')
    rig.peer.until(client.service_is_ready)
    lengths = itertools.cycle([15.0, 130.0, 40.0])
    answers: list[Any] = []

    def change_and_publish() -> None:
        while sum(not answer.done() for answer in answers) < UNANSWERED:
            change = RosParameter('min_length', value=next(lengths)).to_parameter_msg()
            answers.append(client.call_async(SetParameters.Request(parameters=[change])))
        rig.publish(image(SCENE))

    rig.peer.until(lambda: len(answers) > 200, change_and_publish, period=0.02)
    rig.peer.until(lambda: all(answer.done() for answer in answers))
    assert all(answer.result().results[0].successful for answer in answers)
    assert rig.change(min_length=130.0)[0].successful
    expected = Detector(Parameters(min_length=130.0)).detect(SCENE).polylines(0.1)
    assert same(rig.detect(image(SCENE)), expected)
    assert rig.change(min_length=15.0)[0].successful
    account(rig)


def test_listeners_that_come_and_go_a_hundred_times(rig: Rig) -> None:
    peer = rig.peer
    for number in range(100):
        wants_planes = number % 4 == 3
        listener = rig.listen('planes' if wants_planes else ('arcs', 'overlay')[number % 2])
        rig.publish(image(SCENE))
        if wants_planes:  # of these one sees that the detector has seen them; some others are gone
            peer.until(lambda: peer.node.count_subscribers('/camera_info'), period=0.01)
        peer.node.destroy_subscription(listener)
    peer.until(lambda: not peer.node.count_subscribers('/camera_info'))
    listener = rig.listen('arcs')
    assert rig.detect(image(SCENE), 'arcs').width == len(EXPECTED)
    peer.node.destroy_subscription(listener)


def test_a_detector_that_is_stopped_for_a_while(rig: Rig) -> None:
    """The detector continues with the newest frame, and counts the missed ones."""
    rig.settle()
    lost = int(values(rig.report('frames lost'))['frames lost'])
    rig.process.popen.send_signal(signal.SIGSTOP)
    try:
        end = rig.published + 60
        rig.peer.until(lambda: rig.published >= end, lambda: rig.publish(image(SCENE)),
                       period=1 / 30)
    finally:
        rig.process.popen.send_signal(signal.SIGCONT)
    assert same(rig.detect(image(SCENE)), EXPECTED)
    account(rig)
    counts = values(rig.reports[-1])
    assert int(counts['frames lost']) - lost + int(counts['frames dropped']) > 20


def test_two_cameras_on_one_topic(rig: Rig) -> None:
    """Both number their frames independently: their numbers do not count as losses."""
    for _ in range(30):
        rig.detect(image(SCENE))
    rig.settle()
    lost = int(values(rig.report('frames lost'))['frames lost'])
    first, rig.camera = rig.camera, rig.peer.node.create_publisher(
        type(image(SCENE)), rig.topic, 1)
    rig.ready()
    for _ in range(5):
        assert same(rig.detect(image(SCENE)), EXPECTED)
        rig.camera, first = first, rig.camera
    rig.peer.node.destroy_publisher(first)
    # While the second connects, one or the other of its frames may really be lost.
    assert int(values(rig.report('frames lost'))['frames lost']) - lost < 20


def test_another_camera_takes_over(rig: Rig) -> None:
    """The numbers of one camera do not count as losses of the other."""
    rig.settle()
    lost = int(values(rig.report('frames lost'))['frames lost'])
    old = rig.camera
    for _ in range(30):
        rig.detect(image(SCENE))
    rig.camera = rig.peer.node.create_publisher(type(image(SCENE)), rig.topic, 1)
    rig.ready()
    assert same(rig.detect(image(SCENE)), EXPECTED)
    rig.peer.node.destroy_publisher(rig.camera)
    rig.camera = old
    assert same(rig.detect(image(SCENE)), EXPECTED)
    account(rig)
    # On a busy machine one or the other of the thirty may really be lost.
    assert int(values(rig.reports[-1])['frames lost']) - lost < 20


def test_messages_that_are_damaged(rig: Rig) -> None:
    """DDS delivers wrong lengths, text that is not UTF-8, and unknown byte orders."""
    rig.settle()
    good = serialize_message(image(SCENE[:40, :40].copy()))
    frame, encoding = good.index(b'camera_optical'), good.index(b'mono8')
    size = good.index((1600).to_bytes(4, 'little'))
    for at, damage in ((frame, b'\xff\xfe\xff'), (encoding, b'\xff\xc3'), (encoding, b'a\0b'),
                       (frame - 4, b'\xff\xff\xff\x7f'), (frame - 4, bytes(4)),
                       (size, b'\xff\xff\xff\x7f'), (0, bytes(4)), (0, b'\0\x0b\0\0')):
        rig.publish(good[:at] + damage + good[at + len(damage):])
        rig.publish(good[:at])
        assert same(rig.detect(image(SCENE)), EXPECTED), (at, damage)
    account(rig)


def test_a_camera_that_is_killed_and_comes_back(peer: Peer) -> None:
    rig = Rig(peer)
    found = rig.received['segments']
    for _ in range(2):
        camera = peer.run(*CAMERA)
        begin = len(found)
        peer.until(lambda: len(found) > begin + 5)
        assert rig.report('detecting').level == DiagnosticStatus.OK
        camera.popen.kill()
        camera.wait()
        # Nothing comes, and that is said.
        assert rig.report('no frame came in').level == DiagnosticStatus.WARN
    assert 'Traceback' not in rig.process.output
    assert rig.process.stop() == 0


def test_a_result_that_cannot_be_built(peer: Peer, monkeypatch: pytest.MonkeyPatch) -> None:
    """An error in one output is counted and logged, and the other outputs are published."""
    monkeypatch.setattr('rig.NODE', ('-c', WITHOUT_OVERLAY, '--ros-args'))
    rig = Rig(peer, listen=('segments', 'overlay', 'camera_info'), lens='fixed').ready()
    assert rig.detect(image(SCENE)).width
    assert rig.detect(image(SCENE), 'camera_info').width == 320
    assert int(values(rig.report('frames bad: internal error'))['frames bad: internal error']) > 0
    peer.until(lambda: 'ZeroDivisionError: no overlay' in rig.process.output)
    assert not rig.received['overlay']
