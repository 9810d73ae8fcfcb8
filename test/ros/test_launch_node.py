"""
The launch file: which command lines it makes of its arguments, and that the detector takes them.

There are no wheels of the packages launch and launch_ros: the few classes in use are faked by
``fake_launch``.  The workflow runs ``ros2 launch`` itself, in a container of ROS.
"""
from __future__ import annotations

import ast
from pathlib import Path
from typing import TYPE_CHECKING

from fake_launch import commands, DeclareLaunchArgument, description
import pytest
from rcl_interfaces.srv import GetParameters
from rig import image, SCENE
from sensor_msgs.msg import Image, PointCloud2
import yaml

if TYPE_CHECKING:
    from conftest import Peer

ROOT = Path(__file__).parents[2]
FILE = ROOT / 'launch' / 'detector.launch.py'


def test_by_default_the_detector_runs_alone_with_the_defaults() -> None:
    assert commands(FILE) == [[
        'qflsd_ros', 'detector', '--ros-args', '-r', '__node:=detector', '-r', '__ns:=/',
        '--params-file', str(ROOT / 'config' / 'detector.yaml'), '-r', 'image:=image']]


@pytest.mark.parametrize('namespace', ['left', '/left'])
def test_rviz_follows_the_namespace(namespace: str) -> None:
    """It starts on demand, with the installed file, on the topics of this detector."""
    detector, rviz = commands(FILE, namespace=namespace, rviz='true')
    assert '__ns:=/left' in detector
    assert rviz[:2] == ['rviz2', 'rviz2']
    file = Path(rviz[rviz.index('-d') + 1])
    topics = {display['Topic']['Value'] for display in yaml.safe_load(file.read_text())[
        'Visualization Manager']['Displays'] if 'Topic' in display}
    rules = dict(argument.split(':=') for argument in rviz if argument.startswith('/detector/'))
    assert rules == {topic: f'{namespace}{topic}' for topic in topics}


def test_respawn() -> None:
    """Respawn is off by default, and waits before it starts a detector again."""
    launched = description(FILE)
    for given in ('true', 'false'):
        node, = launched.nodes(launched.given({'respawn': given}))
        assert node.respawn.perform({'respawn': given}) == given
        assert node.respawn_delay >= 1
    assert launched.given({})['respawn'] == 'false'


def test_arguments_are_described_and_checked() -> None:
    launched = description(FILE)
    for argument in launched.entities:
        if isinstance(argument, DeclareLaunchArgument):
            assert argument.description and argument.description.endswith('.')
    for name in ('rviz', 'respawn'):
        with pytest.raises(RuntimeError, match=name):
            commands(FILE, **{name: 'perhaps'})


def test_the_detector_takes_what_it_is_launched_with(peer: Peer) -> None:
    """The detector finds arcs in a namespace, on another topic, with parameters from a file."""
    file = peer.folder / 'mine.yaml'
    file.write_text('/left/detector: {ros__parameters: {min_length: 33.0}}')
    (_, executable, *arguments), = commands(FILE, namespace='left', image='/cam/image_raw',
                                            params_file=str(file))
    camera = peer.node.create_publisher(Image, '/cam/image_raw', 1)
    found: list[PointCloud2] = []
    peer.node.create_subscription(PointCloud2, '/left/detector/segments', found.append, 1)
    process = peer.run('-m', 'qflsd_ros.ros', executable, *arguments)
    peer.until(lambda: found, lambda: camera.publish(image(SCENE)))
    value, = peer.call(GetParameters, '/left/detector/get_parameters', names=['min_length']).values
    assert value.double_value == 33.0
    assert process.stop() == 0


def test_nothing_else_needs_launch() -> None:
    """No module of the package imports launch or launch_ros."""
    for module in (ROOT / 'qflsd_ros').rglob('*.py'):
        for node in ast.walk(ast.parse(module.read_text())):
            names = [node.module] if isinstance(node, ast.ImportFrom) else [
                alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not {(name or '').split('.')[0] for name in names} & {'launch', 'launch_ros'}
