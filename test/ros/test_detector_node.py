"""The detector as a process, over real DDS."""
from __future__ import annotations

from array import array
from dataclasses import fields
import itertools
from pathlib import Path
import signal
import time
from typing import Any, Callable, Iterator, TYPE_CHECKING

import cv2
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import pytest
from qflsd_ros import overlay
from qflsd_ros.core import Detector, Parameters
from qflsd_ros.ros.detector import main
from qflsd_ros.ros.output import clouds, palette
from qflsd_ros.ros.parameters.declaration import Settings
from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.srv import (
    GetParameters, ListParameters, SetParameters, SetParametersAtomically)
from rclpy.parameter import Parameter as RosParameter
from rig import BLACK, EXPECTED, header, image, NODE, Rig, same, SCENE, stamps, values
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage, PointCloud2
from visualization_msgs.msg import Marker
import yaml

if TYPE_CHECKING:
    from conftest import Peer

ROOT = Path(__file__).parents[2]
BIG_CAMERA = """
import array, rclpy
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image
rclpy.init()
node = rclpy.create_node('camera')
publisher = node.create_publisher(Image, 'image', qos_profile_sensor_data)
image = Image(height=1080, width=1920, step=5760, encoding='bgr8')
image.header.frame_id = 'big'
image.data = array.array('B', bytes(1080 * 5760))
node.create_timer(0.1, lambda: publisher.publish(image))
rclpy.spin(node)
"""
FOUR_K_CAMERA = BIG_CAMERA.replace(
    "height=1080, width=1920, step=5760, encoding='bgr8'",
    "height=2160, width=3840, step=3840, encoding='mono8'").replace(
    'bytes(1080 * 5760)', '__import__("os").urandom(2160 * 3840)')


@pytest.fixture(scope='module')
def rig(module_peer: Peer) -> Iterator[Rig]:
    """Give one detector, shared by the tests of this module."""
    yield Rig(module_peer, listen=('segments', 'arcs', 'markers', 'overlay')).ready()


def test_segments_are_those_of_the_core(rig: Rig) -> None:
    assert len(EXPECTED) > 4 and max(map(len, EXPECTED)) > 4
    assert same(rig.detect(image(SCENE)), EXPECTED)


def test_every_output_shows_the_same_arcs(rig: Rig) -> None:
    arcs = Detector().detect(SCENE)
    rows = clouds.records(rig.detect(image(SCENE), 'arcs'))
    assert rows['length'] == pytest.approx(arcs.table['length'], rel=1e-5)
    marker, = rig.detect(image(SCENE), 'markers').markers
    assert len(marker.points) == 2 * sum(len(line) - 1 for line in EXPECTED)
    picture = rig.detect(image(SCENE), 'overlay')
    expected = overlay.draw(SCENE, arcs, Settings().line_width)
    assert picture.encoding == 'bgr8' and bytes(picture.data) == expected.tobytes()


def test_colours_of_markers_follow_the_parameter(rig: Rig) -> None:
    arcs = Detector().detect(SCENE)
    for by in ('length', 'curvature', 'score', 'id', 'track'):
        assert rig.change(marker_colour=by)[0].successful
        marker, = rig.detect(image(SCENE), 'markers').markers
        shown = {(colour.b, colour.g, colour.r) for colour in marker.colors}
        wanted = {tuple(row) for row in palette.colours(arcs, by).tolist()}
        assert {tuple(round(255 * part) for part in colour) for colour in shown} == wanted
    assert not rig.change(marker_colour='mood')[0].successful


def test_an_empty_frame_gives_empty_messages(rig: Rig) -> None:
    assert rig.detect(image(BLACK)).width == 0
    assert rig.detect(image(BLACK), 'arcs').width == 0
    assert rig.detect(image(BLACK), 'markers').markers[0].action == Marker.DELETE
    assert not np.any(rig.detect(image(BLACK), 'overlay').data)


@pytest.mark.parametrize('encoding, pixels', [
    ('8UC1', SCENE), ('mono16', SCENE * np.uint16(257)),
    ('bgr8', np.dstack([SCENE] * 3)), ('rgb8', np.dstack([SCENE] * 3)),
    ('bgra8', np.dstack([SCENE] * 4)), ('rgba8', np.dstack([SCENE] * 4)),
    ('yuyv', np.dstack([SCENE, BLACK])), ('32FC1', SCENE / np.float32(255))])
def test_encodings(rig: Rig, encoding: str, pixels: np.ndarray) -> None:
    assert same(rig.detect(image(pixels, encoding)), EXPECTED)


def test_step_and_byte_order(rig: Rig) -> None:
    wide = np.pad(SCENE.astype('>u2') * np.uint16(257), ((0, 0), (0, 7)))
    message = image(wide.astype('>u2'), 'mono16', width=320, is_bigendian=1)
    assert same(rig.detect(message), EXPECTED)


def test_bad_frames_are_named_and_the_next_one_works(peer: Peer) -> None:
    rig = Rig(peer).ready()
    rig.show(image(SCENE, encoding='e' * 1_000_000), "encoding 'eee")
    rig.show(image(SCENE, encoding='bgr9'), "encoding 'bgr9' is unknown: must be one of 16UC1")
    rig.show(image(SCENE, height=40000), '320 x 40000 pixels: width and height must lie in')
    rig.show(image(SCENE, step=319), 'step is 319, must be at least 320')
    rig.show(image(SCENE, data=array('B', b'123')), 'holds 3 bytes, must be at least')
    assert 'Traceback' not in rig.process.output and len(rig.process.output) < 20_000
    assert same(rig.detect(image(SCENE)), EXPECTED)
    rig.change(max_pixels=SCENE.size - 1)
    rig.show(image(SCENE), f'at most {SCENE.size - 1} pixels in all')
    rig.change(max_pixels=SCENE.size)
    assert same(rig.detect(image(SCENE)), EXPECTED)


def test_bad_frames_are_counted_by_reason(rig: Rig) -> None:
    bad = itertools.cycle([image(SCENE, encoding='bgr9'), image(SCENE, step=3)])
    rig.reports.clear()
    rig.peer.until(lambda: any(
        status.level == DiagnosticStatus.WARN and 'unknown encoding' in status.message
        and 'step too small' in status.message for status in rig.reports),
        lambda: rig.camera.publish(next(bad)))
    last = values(rig.reports[-1])
    assert int(last['frames bad']) >= 2
    assert int(last['frames bad: unknown encoding']) >= 1
    assert int(last['frames bad: step too small']) >= 1
    # Many bad frames, few lines: one of each kind within five seconds.
    assert rig.process.output.count("'bgr9'") < int(last['frames bad: unknown encoding'])


def test_frames_that_change_size_midway(rig: Rig) -> None:
    for size in ((1, 1), (3, 900), (480, 640), (240, 320)):
        pixels = cv2.resize(SCENE, size[::-1], interpolation=cv2.INTER_NEAREST)
        assert same(rig.detect(image(pixels)), Detector().detect(pixels).polylines(0.1))


def test_parameters_take_effect_on_the_next_frame(rig: Rig) -> None:
    changed = Parameters(min_length=130.0)
    expected = Detector(changed).detect(SCENE).polylines(2.0)
    assert 0 < len(expected) < len(EXPECTED)
    assert all(result.successful for result in rig.change(min_length=130, polyline_tolerance=2.0))
    assert same(rig.detect(image(SCENE)), expected)
    assert all(result.successful for result in rig.change(min_length=15.0, polyline_tolerance=0.1))
    assert same(rig.detect(image(SCENE)), EXPECTED)


def test_parameters_are_refused_with_a_reason(rig: Rig) -> None:
    for changes, text in (
            ({'contrast_low': 200.0}, 'contrast_high'), ({'method': 'magic'}, 'arcs, paper')):
        result, = rig.change(**changes)
        assert not result.successful and text in result.reason, result.reason
    # rclpy words these reasons, differently from one distribution to the next.
    for name, value in (('tolerance', 99.0), ('image_transport', 'raw'), ('no_such_thing', 1)):
        result, = rig.change(**{name: value})
        assert not result.successful and result.reason
    both = [RosParameter('min_length', value=100.0).to_parameter_msg(),
            RosParameter('line_width', value=0).to_parameter_msg()]
    answer = rig.peer.call(SetParametersAtomically, '/detector/set_parameters_atomically',
                           parameters=both)
    assert not answer.result.successful
    assert same(rig.detect(image(SCENE)), EXPECTED)


def test_a_dump_of_all_parameters_loads_back(rig: Rig, peer: Peer) -> None:
    def parameters_of(one: Peer) -> dict[str, Any]:
        names = one.call(ListParameters, '/detector/list_parameters').result.names
        found = one.call(GetParameters, '/detector/get_parameters', names=names).values
        return {name: RosParameter.from_parameter_msg(ParameterMsg(name=name, value=value)).value
                for name, value in zip(names, found)}
    assert rig.change(line_width=7, hardware_id='left')[0].successful
    dumped = parameters_of(rig.peer)
    assert rig.change(line_width=2, hardware_id='')[0].successful
    assert {field.name for kind in (Parameters, Settings) for field in fields(kind)} \
        <= set(dumped)
    assert {name for name in dumped if name.startswith('qos_overrides./image.subscription.')}
    file = peer.folder / 'dump.yaml'
    file.write_text(yaml.safe_dump({'/detector': {'ros__parameters': dumped}}))
    other = Rig(peer, '--params-file', str(file)).ready()
    assert parameters_of(peer) == dumped
    assert 'no parameter' not in other.process.output


def test_the_file_in_the_tree_loads(peer: Peer) -> None:
    rig = Rig(peer, '--params-file', 'config/detector.yaml').ready()
    assert same(rig.detect(image(SCENE)), EXPECTED)
    assert 'WARN' not in rig.process.output


def test_a_misspelt_parameter_is_told_with_the_right_name(peer: Peer) -> None:
    file = peer.folder / 'typo.yaml'
    file.write_text('/**: {ros__parameters: {min_lenght: 40.0, tolerance: 1, zzzz: 2}}')
    rig = Rig(peer, '--params-file', str(file), '-p',
              'qos_overrides./image.subscription.dept:=2').ready()
    peer.until(lambda: rig.process.output.count('it is ignored') == 3)
    assert 'no parameter min_lenght, it is ignored: did you mean min_length?' in rig.process.output
    assert 'no parameter zzzz, it is ignored' in rig.process.output
    assert 'did you mean qos_overrides./image.subscription.depth?' in rig.process.output
    # An integer will do for a floating-point number.
    expected = Detector(Parameters(tolerance=1.0)).detect(SCENE).polylines(0.1)
    assert same(rig.detect(image(SCENE)), expected)


@pytest.mark.parametrize('argument, texts', [
    ('tolerance:=99.0', ['tolerance is 99.0', '0.1 to 10.0 px']),
    ('lens:=on', ['lens is True', 'must be of type str']),
    ('tolerance:=wide', ["tolerance is 'wide'", 'float']),
    ('image_transport:=theora', ['image_transport', 'raw, compressed']),
    ('use_sim_time:=7', ['use_sim_time']),
    ('mask:=nowhere.png', ['mask', 'nowhere.png', 'No such file']),
    ('mask:=setup.py', ['mask', 'setup.py', 'no image that can be read']),
    ('mask:=/dev/zero', ['parameter mask', '/dev/zero', 'is no file']),
    ('qos_overrides./image.subscription.reliability:=maybe', ['reliability', 'maybe']),
    ('qos_overrides./detector/segments.publisher.depth:=deep', ['depth', 'deep']),
])
def test_a_bad_value_at_start_ends_with_one_clear_line(
        refuse: Callable[..., str], argument: str, texts: list[str]) -> None:
    """Also as a process, see test_run_node.py."""
    line = refuse(main, '-p', argument)
    assert line.startswith('detector: ') and all(text in line for text in texts), line


def test_a_missing_parameter_file_is_named(peer: Peer) -> None:
    process = peer.run(*NODE, '--params-file', 'no_such.yaml')
    assert process.wait() == 2
    assert 'no_such.yaml' in process.output and 'Traceback' not in process.output


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signals_end_the_node_cleanly(peer: Peer, number: int) -> None:
    rig = Rig(peer).ready()
    rig.detect(image(SCENE))
    rig.camera.publish(image(SCENE))
    assert rig.process.stop(number) == 0
    assert 'Traceback' not in rig.process.output and 'Exception' not in rig.process.output


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signals_while_the_node_is_starting(peer: Peer, number: int) -> None:
    process = peer.run(*NODE)
    peer.until(lambda: 'detector' in peer.node.get_node_names(), period=0.001)
    assert process.stop(number) == 0
    assert 'Traceback' not in process.output and 'Exception' not in process.output


def test_the_camera_is_left_alone_while_nobody_listens(peer: Peer) -> None:
    rig = Rig(peer, listen=())
    assert rig.report('nobody listens').level == DiagnosticStatus.OK
    assert rig.camera.get_subscription_count() == 0
    for _ in range(2):
        listener = rig.listen('arcs')
        assert clouds.records(rig.detect(image(SCENE), 'arcs')).size == len(EXPECTED)
        peer.node.destroy_subscription(listener)
        peer.until(lambda: rig.camera.get_subscription_count() == 0)


def test_compressed_images(peer: Peer) -> None:
    rig = Rig(peer, '-p', 'image_transport:=compressed', '-r', 'image:=/cam/image_raw',
              topic='/cam/image_raw/compressed', camera_type=CompressedImage).ready()
    for extension in ('.png', '.jpg'):
        data = cv2.imencode(extension, SCENE)[1]
        gray = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
        message = CompressedImage(format=extension[1:], data=array('B', data.tobytes()))
        message.header = image(SCENE).header
        assert same(rig.detect(message), Detector().detect(gray).polylines(0.1))
    rig.show(CompressedImage(format='png', data=array('B', data[:50].tobytes())),
             'cannot be decoded')
    # A camera of 10 bits: dark unless the node knows what is white.
    deep = cv2.imencode('.png', np.rint(SCENE * (1023 / 255)).astype(np.uint16))[1]
    message = CompressedImage(format='16UC1; png compressed', data=array('B', deep.tobytes()))
    message.header = image(SCENE).header
    rig.change(white_level=1023.0)
    assert same(rig.detect(message), EXPECTED)


def test_namespace_remapping_and_a_section_of_yaml(peer: Peer) -> None:
    file = peer.folder / 'two.yaml'
    file.write_text('/left/detector: {ros__parameters: {min_length: 100.0}}\n'
                    '/right/detector: {ros__parameters: {min_length: 9000.0}}\n'
                    '/**: {ros__parameters: {hardware_id: rig}}\n')
    rig = Rig(peer, '-r', '__ns:=/left', '-r', 'image:=front/image_raw', '--params-file',
              str(file), node='/left/detector', topic='/left/front/image_raw').ready()
    expected = Detector(Parameters(min_length=100.0)).detect(SCENE).polylines(0.1)
    assert same(rig.detect(image(SCENE)), expected)
    status = rig.report('frames')
    assert (status.name, status.hardware_id) == ('/left/detector: detection', 'rig')


def test_simulated_time_that_jumps_back(peer: Peer) -> None:
    rig = Rig(peer, '-p', 'use_sim_time:=true')
    clock = peer.node.create_publisher(Clock, '/clock', 10)
    for now in (5000, 20):
        tick = Clock()
        tick.clock.sec = now

        def report() -> Any:
            # The steady clock drives diagnostics: they come though simulated time stands still.
            return next((status for status in rig.reports
                         if values(status)['age median (ms)'] == f'{(now - 10) * 1e3:.1f}'), None)

        def step() -> None:
            clock.publish(tick)
            message = image(SCENE)
            message.header.stamp.sec = 10
            rig.camera.publish(message)

        assert peer.until(report, step).level == DiagnosticStatus.WARN
    assert all(answer.header.stamp.sec == 10 for answer in rig.received['segments'])


@pytest.mark.alone
def test_the_newest_frame_wins_and_the_others_are_counted(peer: Peer) -> None:
    rig = Rig(peer, '-p', 'method:=paper').ready()
    random = np.random.default_rng(0)
    noise = random.integers(0, 255, (120, 160), np.uint8)
    big = image(cv2.resize(noise, (480, 360), interpolation=cv2.INTER_NEAREST))

    def burst() -> None:
        big.header.stamp.sec = next(stamps)
        rig.camera.publish(big)

    peer.until(lambda: any('frames dropped' in status.message for status in rig.reports), burst,
               period=0.01)
    # Parameter services answer while detection is busy.
    begin = time.monotonic()
    assert rig.change(line_width=4)[0].successful
    assert time.monotonic() - begin < 5
    # The last frame shown is the last one answered.
    peer.until(lambda: rig.received['segments'] and header(rig.received['segments'][-1]).stamp.sec
               == big.header.stamp.sec)


@pytest.mark.alone
def test_parameter_services_answer_while_4k_frames_are_worked_on(peer: Peer) -> None:
    """The median answer takes less than half of a frame, although the node is never idle."""
    profile = {'FASTRTPS_DEFAULT_PROFILES_FILE': str(ROOT / 'config' / 'fastdds.xml')}
    rig = Rig(peer, '-p', 'blur_sigma:=5.0', **profile)
    peer.run('-c', FOUR_K_CAMERA, **profile)
    peer.until(lambda: len(rig.received['segments']) > 1)
    client = peer.node.create_client(SetParameters, '/detector/set_parameters')
    peer.until(client.service_is_ready)
    times = []
    begin, started = len(rig.received['segments']), time.monotonic()
    while len(rig.received['segments']) < begin + 3:
        change = RosParameter('line_width', value=1 + len(times) % 9).to_parameter_msg()
        sent = time.monotonic()
        answer = client.call_async(SetParameters.Request(parameters=[change]))
        peer.until(answer.done)
        times.append(time.monotonic() - sent)
        assert answer.result().results[0].successful
    assert np.median(times) < 0.5 * (time.monotonic() - started) / 3


def test_the_profile_lets_large_images_through(peer: Peer) -> None:
    profile = {'FASTRTPS_DEFAULT_PROFILES_FILE': str(ROOT / 'config' / 'fastdds.xml')}
    detector = peer.run(*NODE, **profile)
    camera = peer.run('-c', BIG_CAMERA, **profile)
    received: list[PointCloud2] = []
    peer.node.create_subscription(PointCloud2, '/detector/segments', received.append, 10)
    peer.until(lambda: len(received) > 10)
    assert {message.header.frame_id for message in received} == {'big'}
    assert 'XML' not in detector.output + camera.output


def test_the_example_prints_segments(peer: Peer) -> None:
    rig = Rig(peer).ready()
    example = peer.run('examples/segments_subscriber.py', '--ros-args', '-r',
                       'segments:=/detector/segments')
    peer.until(lambda: f'{len(EXPECTED)} segments, the longest from' in example.output,
               lambda: rig.camera.publish(image(SCENE)))
    peer.until(lambda: '0 segments' in example.output, lambda: rig.camera.publish(image(BLACK)))
    example.popen.send_signal(signal.SIGINT)
    # rclpy misses a signal between two waits until the next message comes.
    peer.until(lambda: example.popen.poll() is not None, lambda: rig.camera.publish(image(BLACK)))
    assert example.wait() == 0
