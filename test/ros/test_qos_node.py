"""Quality of service: any camera, started before or after the detector, and every override."""
from __future__ import annotations

from pathlib import Path
import re
import shlex
from typing import Any, Callable, TYPE_CHECKING

import pytest
from rclpy.qos import qos_profile_sensor_data, QoSProfile, ReliabilityPolicy
from rig import EXPECTED, image, Rig, same, SCENE, TYPES
from sensor_msgs.msg import CompressedImage, Image

if TYPE_CHECKING:
    from conftest import Peer

BEST_EFFORT, RELIABLE = ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE
RUNNING = (Path(__file__).parents[2] / 'doc' / 'running.md').read_text()
PUBLISHED = ('/detector/segments', '/detector/arcs', '/detector/markers', '/detector/overlay',
             '/detector/planes', '/diagnostics')


def policy(peer: Peer, look_up: Callable[[str], list[Any]], topic: str) -> ReliabilityPolicy:
    """Return the reliability of the one endpoint of a topic, when discovery has found it."""
    peer.until(lambda: look_up(topic))
    info, = look_up(topic)
    return info.qos_profile.reliability


def test_both_kinds_of_camera_before_and_after_the_detector(peer: Peer) -> None:
    rig = Rig(peer).ready()
    assert same(rig.detect(image(SCENE)), EXPECTED)
    for reliability in (RELIABLE, BEST_EFFORT):
        peer.node.destroy_publisher(rig.camera)
        rig.camera = peer.node.create_publisher(
            Image, '/image', QoSProfile(depth=1, reliability=reliability))
        assert same(rig.detect(image(SCENE)), EXPECTED)


@pytest.mark.parametrize('overridden', [False, True])
def test_every_topic_follows_its_override(peer: Peer, overridden: bool) -> None:
    """The camera is a reliable one that was there before the detector."""
    arguments: list[str] = []
    if overridden:
        for topic in PUBLISHED:
            arguments += ['-p', f'qos_overrides.{topic}.publisher.reliability:=best_effort']
        for topic in ('/image', '/camera_info'):
            arguments += ['-p', f'qos_overrides.{topic}.subscription.reliability:=reliable',
                          '-p', f'qos_overrides.{topic}.subscription.depth:=3']
    rig = Rig(peer, *arguments, listen=(),
              camera_qos=QoSProfile(depth=1, reliability=RELIABLE))
    for output in ('segments', 'planes'):
        rig.subscriptions[output] = peer.node.create_subscription(
            TYPES[output], f'/detector/{output}', rig.received[output].append,
            qos_profile_sensor_data)
    rig.ready()
    assert same(rig.detect(image(SCENE)), EXPECTED)
    out, into = (BEST_EFFORT, RELIABLE) if overridden else (RELIABLE, BEST_EFFORT)
    for topic in PUBLISHED:
        assert policy(peer, peer.node.get_publishers_info_by_topic, topic) == out, topic
    for topic in ('/image', '/camera_info'):
        assert policy(peer, peer.node.get_subscriptions_info_by_topic, topic) == into, topic
    assert 'no parameter' not in rig.process.output


def flags(title: str) -> list[str]:
    """Return the flags that doc/running.md says to add for something."""
    return shlex.split(re.search(rf'^\| {title}.*\| `([^`]*)` \|$', RUNNING, re.MULTILINE)[1])


@pytest.mark.parametrize('transport, topic', [
    ([], '/cam/image_raw'),
    (flags('read `/cam/image_raw/compressed`'), '/cam/image_raw/compressed')])
def test_the_override_of_the_documents_beside_its_remap(peer: Peer, transport: list[str],
                                                        topic: str) -> None:
    command = shlex.split(re.search('ros2 run qflsd_ros detector (--ros-args -r .*)', RUNNING)[1])
    override = [flag.replace('/cam/image_raw', topic)
                for flag in flags('change the quality of service')]
    remap = command[1:command.index('--params-file')]
    rig = Rig(peer, *remap, *transport, *override, topic=topic,
              camera_type=CompressedImage if transport else Image,
              camera_qos=QoSProfile(depth=1, reliability=RELIABLE))
    rig.ready()
    assert policy(peer, peer.node.get_subscriptions_info_by_topic, topic) == RELIABLE
    assert 'it is ignored' not in rig.process.output


def test_an_override_of_a_topic_that_is_not_subscribed_to_is_told(peer: Peer) -> None:
    """The name before remapping is no name."""
    rig = Rig(peer, '-r', 'image:=/cam/image_raw', '-p',
              'qos_overrides./image.subscription.reliability:=reliable', topic='/cam/image_raw')
    peer.until(lambda: 'no parameter qos_overrides./image.subscription.reliability, it is ignored'
               in rig.process.output)
    assert 'did you mean qos_overrides./cam/image_raw.subscription.reliability?' \
        in rig.process.output
