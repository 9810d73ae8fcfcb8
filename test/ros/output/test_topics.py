"""Every output is built from a result, and those whose needs are not met give the reason."""
from __future__ import annotations

from dataclasses import replace

from builtin_interfaces.msg import Time
import numpy as np
import pytest
from qflsd_ros.core import Attitude, Detector, DivisionModel, Tracker
from qflsd_ros.overlay import NO_TAILS
from qflsd_ros.ros.input.subscriptions import calibration_topic
from qflsd_ros.ros.output import clouds
from qflsd_ros.ros.output.topics import (
    attitude, calibration, distortion, Output, OUTPUTS, Result, tracked, with_straightness)
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources.frames import FrameError
from rclpy.serialization import deserialize_message
from rig import SCENE
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header

ARCS = Tracker().track(SCENE)
# Of the scene there is none: one of its arcs points upwards, none of the others does.
ATTITUDE = Attitude(
    200.0, 1.0, np.array([0.0, -1, 0]), 0.01, np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    np.where(np.arange(len(ARCS)) == 0, 0, -1),
    DivisionModel(-0.2, SCENE.shape), 0.0,
    np.array([[200.0, 0, 0], [0, 200.0, 0], [0, 0, 1]]))
RESULT = Result(
    Header(frame_id='eye'), SCENE, ARCS, Settings(),
    DivisionModel(-0.2, SCENE.shape), NO_TAILS,
    CameraInfo(height=240, width=320, distortion_model='plumb_bob', d=[0.0] * 5,
               k=[200.0, 0, 160, 0, 200, 120, 0, 0, 1]), '/cam/camera_info', ATTITUDE)
every_output = pytest.mark.parametrize('output', OUTPUTS, ids=lambda output: output.topic[2:])


@every_output
def test_messages_have_their_type_and_the_header_of_the_image(output: Output) -> None:
    message = output.message(RESULT)
    if isinstance(message, bytes):
        message = deserialize_message(message, output.message_type)
    assert type(message) is output.message_type
    header = message.markers[0].header if hasattr(message, 'markers') else message.header
    assert header == RESULT.header


@every_output
def test_an_output_fails_only_without_what_it_needs(output: Output) -> None:
    for need, changes, reason in ((distortion, {'model': None}, 'no lens'),
                                  (calibration, {'calibration': None}, 'no camera_info'),
                                  (tracked, {'arcs': Detector().detect(SCENE)}, 'no tracks'),
                                  (attitude, {'attitude': None}, 'no attitude')):
        result = replace(RESULT, **changes)
        if need in output.needs:
            with pytest.raises(FrameError) as caught:
                output.message(result)
            assert caught.value.reason == reason
        else:
            assert output.message(result)


def test_straightness_is_computed_once_for_all_outputs() -> None:
    assert with_straightness(RESULT) is with_straightness(RESULT)
    rows = {output.topic: clouds.records(output.message(RESULT)) for output in OUTPUTS
            if with_straightness in output.needs}
    shown = np.flatnonzero(~(rows['~/arcs']['straight'] < 0.5))
    assert 0 < len(shown) and np.unique(rows['~/rectified']['segment']).tolist() == shown.tolist()


@pytest.mark.parametrize('image, info', [
    ('/image', '/camera_info'), ('/cam/image_raw', '/cam/camera_info')])
def test_camera_info_is_expected_beside_the_image(image: str, info: str) -> None:
    assert calibration_topic(image) == info


def test_only_line_features_leave_out_images() -> None:
    """At 10 Hz, every third of 30 Hz; all others have a message for every image."""
    passed: dict[str, list[int]] = {}
    for number in range(30):
        result = replace(RESULT, header=Header(stamp=Time(
            sec=number // 30, nanosec=number * 10**9 // 30 % 10**9)))
        for output in OUTPUTS:
            if output.passes(result):
                passed.setdefault(output.topic, []).append(number)
    assert passed.pop('~/line_features') == list(range(0, 30, 3))
    assert all(numbers == list(range(30)) for numbers in passed.values())
