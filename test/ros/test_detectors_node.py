"""The detectors of several cameras in one process: each works as if it ran alone."""
from __future__ import annotations

import signal
import time
from typing import Any, Callable, TYPE_CHECKING

import numpy as np
import pytest
from qflsd_ros.core import Detector, Parameters
from qflsd_ros.ros.detectors import main, node_arguments
from rcl_interfaces.srv import GetParameters
from rig import image, Rig, same, SCENE, values
import yaml

if TYPE_CHECKING:
    from conftest import Peer, Process

NODE = ('-m', 'qflsd_ros.ros', 'detectors', '--ros-args')
LENGTHS = {'front': 15.0, 'left': 60.0}
QUIET = ('-p', 'lens:=off', '-p', 'tracking:=false', '-r', 'image:=camera/image_raw')
PROMPT = 2.0    # s from a signal to the end


def rig_of(peer: Peer, side: str, process: Process) -> Rig:
    """Return the rig of one camera of a process."""
    return Rig(peer, node=f'/{side}/detector', topic=f'/{side}/camera/image_raw',
               process=process).ready()


def start(peer: Peer, *arguments: str) -> Process:
    """Start both cameras with a file that has a section for each."""
    file = peer.folder / 'cameras.yaml'
    file.write_text(yaml.safe_dump({
        f'/{side}/detector': {'ros__parameters': {'min_length': length, 'hardware_id': side}}
        for side, length in LENGTHS.items()}))
    return peer.run(*NODE, *QUIET, '-p', "cameras:=['front', 'left']", '--params-file', str(file),
                    *arguments)


def picture(side: str) -> np.ndarray:
    return np.roll(SCENE, 7 if side == 'front' else 31, axis=1)


def expected(side: str, **changes: Any) -> list[np.ndarray]:
    parameters = Parameters(**{'min_length': LENGTHS[side]} | changes)
    return Detector(parameters).detect(picture(side)).polylines(0.1)


def test_each_camera_has_its_own(peer: Peer) -> None:
    """Parameters of the file, and set later; topics; diagnostics.  SIGINT ends all, code 0."""
    process = start(peer)
    rigs = {side: rig_of(peer, side, process) for side in LENGTHS}
    tolerance = peer.call(GetParameters, '/front/detector/get_parameters',
                          names=['polyline_tolerance']).values[0].double_value
    assert tolerance == 0.1
    for side, rig in rigs.items():
        assert same(rig.detect(image(picture(side))), expected(side)), side
    assert rigs['left'].change(min_length=120.0)[0].successful
    assert len(expected('left', min_length=120.0)) < len(expected('left'))
    assert same(rigs['left'].detect(image(picture('left'))), expected('left', min_length=120.0))
    assert same(rigs['front'].detect(image(picture('front'))), expected('front'))
    for side, rig in rigs.items():
        status = peer.until(lambda: next((status for status in rig.reports if status.name ==
                                          f'/{side}/detector: detection'), None))
        assert status.hardware_id == side
    begin = time.monotonic()
    assert process.stop() == 0
    assert time.monotonic() - begin < PROMPT
    assert 'Traceback' not in process.output and 'no parameter' not in process.output


def test_bad_frames_of_one_do_not_disturb_the_other(peer: Peer) -> None:
    process = start(peer)
    front, left = (rig_of(peer, side, process) for side in LENGTHS)
    bad = image(SCENE, encoding='no such encoding')
    front.show(bad, 'no such encoding')
    for _ in range(5):
        front.publish(bad)
        assert same(left.detect(image(picture('left'))), expected('left'))
    status = peer.until(lambda: next(
        (status for status in left.reports if status.name == '/left/detector: detection'
         and int(values(status)['frames']) >= 5), None))
    assert values(status)['frames bad'] == '0'
    assert same(front.detect(image(picture('front'))), expected('front'))   # it goes on, too
    assert process.stop(signal.SIGTERM) == 0


FAULTY = """
import sys
from qflsd_ros.ros import detector
diagnose = detector.DetectorNode._diagnose
def fail(node):
    if node.get_namespace() == '/front':
        raise OSError('a fault in a callback')
    diagnose(node)
detector.DetectorNode._diagnose = fail
from qflsd_ros.ros.__main__ import detectors
sys.exit(detectors())
"""


def test_a_fault_ends_one_camera_alone(peer: Peer) -> None:
    """An exception in a callback, which would end the node ``detector`` with its process."""
    process = peer.run('-c', FAULTY, '--ros-args', *QUIET, '-p', "cameras:=['front', 'left']")
    left = rig_of(peer, 'left', process)
    peer.until(lambda: '/front/detector has ended' in process.output)
    assert 'a fault in a callback' in process.output
    peer.until(lambda: ('detector', '/front') not in
               peer.node.get_node_names_and_namespaces())
    assert same(left.detect(image(picture('left'))), expected('left', min_length=15.0))
    assert process.stop() == 0


def test_the_process_ends_with_its_last_camera(peer: Peer) -> None:
    process = peer.run('-c', FAULTY, '--ros-args', '-p', "cameras:=['front']")
    assert process.wait() == 1
    assert '/front/detector has ended' in process.output
    assert 'no camera is left' in process.output


def test_a_camera_that_cannot_be_started_is_left_out(peer: Peer) -> None:
    """The log names the parameter; the other camera works."""
    file = peer.folder / 'bad.yaml'
    file.write_text('/front/detector:\n  ros__parameters:\n    min_length: -1.0\n')
    process = start(peer, '--params-file', str(file))
    left = rig_of(peer, 'left', process)
    assert same(left.detect(image(picture('left'))), expected('left'))
    assert '/front/detector cannot be started: parameter min_length is -1.0' in process.output
    assert f'{file}, line 3)' in process.output
    assert ('detector', '/front') not in peer.node.get_node_names_and_namespaces()
    assert process.stop() == 0


def test_a_file_for_some_of_the_cameras(peer: Peer) -> None:
    """It is right for the others, too; one that names none of them is not."""
    for name in ('left', 'rear'):
        (peer.folder / f'{name}.yaml').write_text(
            f'/{name}/detector:\n  ros__parameters:\n    min_length: 60.0\n')
    process = start(peer, *(argument for name in ('left', 'rear') for argument in
                            ('--params-file', str(peer.folder / f'{name}.yaml'))))
    left = rig_of(peer, 'left', process)
    assert same(left.detect(image(picture('left'))), expected('left'))
    warnings = [line for line in process.output.splitlines() if 'no section matches' in line]
    assert len(warnings) == 2 and all('rear.yaml' in line for line in warnings)


@pytest.mark.parametrize('arguments, reason', [
    ((), 'not given or empty'),
    (('-p', 'cameras:=7'), 'must be a list of namespaces'),
    (('-p', "cameras:=['front', '/front']"), 'more than once'),
    (('-p', "cameras:=['front side']"), "contains 'front side'")])
def test_cameras_that_cannot_be_used(refuse: Callable[..., str], arguments: tuple[str, ...],
                                     reason: str) -> None:
    line = refuse(main, *QUIET, *arguments)
    assert line.startswith('detectors: ') and reason in line


def test_no_camera_that_can_be_started(peer: Peer) -> None:
    process = peer.run(*NODE, '-p', "cameras:=['front']", '-p', 'min_length:=-1.0')
    assert process.wait() == 2
    line = process.output.splitlines()[-1]
    assert line.startswith('detectors: ') and 'no camera can be started' in line


def test_namespace_and_name_of_the_process(peer: Peer) -> None:
    """As launch gives them: cameras are in the namespace, and keep their names."""
    start(peer, '-r', '__ns:=/car', '-r', '__node:=all')
    peer.until(lambda: {('all', '/car'), ('detector', '/car/front'), ('detector', '/car/left')}
               <= set(peer.node.get_node_names_and_namespaces()))


def test_arguments_of_a_camera() -> None:
    """Names, namespaces and the list of cameras are of the process; all else is of each node."""
    assert node_arguments(['detectors', '--ros-args', '-r', '__ns:=/car', '--remap',
                           '__node:=all', '-p', 'cameras:=[a]', '-p', 'min_length:=9.0', '-r',
                           'image:=image_raw']) == [
        '--ros-args', '-p', 'min_length:=9.0', '-r', 'image:=image_raw']
    assert node_arguments(['detectors']) == []
