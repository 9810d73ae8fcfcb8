"""Quality of service: any camera, started before or after the detector, and every override."""
from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from rclpy.qos import qos_profile_sensor_data, QoSProfile, ReliabilityPolicy
from rig import EXPECTED, image, Rig, same, SCENE, TYPES
from sensor_msgs.msg import Image

if TYPE_CHECKING:
    from conftest import Peer

BEST_EFFORT, RELIABLE = ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE
PUBLISHED = ('/detector/segments', '/detector/arcs', '/detector/markers', '/detector/overlay',
             '/detector/planes', '/diagnostics')


def test_both_kinds_of_camera_before_and_after_the_detector(peer: Peer) -> None:
    rig = Rig(peer).ready()
    assert same(rig.detect(image(SCENE)), EXPECTED)
    for reliability in (RELIABLE, BEST_EFFORT):
        peer.node.destroy_publisher(rig.camera)
        rig.camera = peer.node.create_publisher(
            Image, '/image', QoSProfile(depth=1, reliability=reliability))
        assert same(rig.detect(image(SCENE)), EXPECTED)


def test_a_reliable_camera_that_was_there_before(peer: Peer) -> None:
    rig = Rig(peer, camera_qos=QoSProfile(depth=1, reliability=RELIABLE)).ready()
    assert same(rig.detect(image(SCENE)), EXPECTED)


@pytest.mark.parametrize('overridden', [False, True])
def test_every_topic_follows_its_override(peer: Peer, overridden: bool) -> None:
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
        info, = peer.node.get_publishers_info_by_topic(topic)
        assert info.qos_profile.reliability == out, topic
    for topic in ('/image', '/camera_info'):
        info, = peer.node.get_subscriptions_info_by_topic(topic)
        assert info.qos_profile.reliability == into, topic
    assert 'no parameter' not in rig.process.output
