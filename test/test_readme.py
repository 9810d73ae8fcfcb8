"""What the README says of parameters, topics and the Python library is so."""
from __future__ import annotations

import importlib
from pathlib import Path
import re
import runpy
from typing import Any

import cv2
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import pytest
from qflsd_ros.core import Detector
from qflsd_ros.ros.diagnostics import Statistics
from qflsd_ros.ros.input.images import LAYOUTS
from qflsd_ros.ros.input.subscriptions import calibration_topic
from qflsd_ros.ros.lens import CameraLens
from qflsd_ros.ros.output import clouds
from qflsd_ros.ros.output.topics import OUTPUTS
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources import Scene
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import Header

ROOT = Path(__file__).parents[1]
README = (ROOT / 'README.md').read_text()
TYPES = {'f4': 'float32', 'i4': 'int32', 'u4': 'uint32'}


def section(title: str) -> str:
    """Return the text below a heading, up to the next one of any depth."""
    return re.search(rf'^#+ {title}\n(.*?)(?=^#|\Z)', README, re.DOTALL | re.MULTILINE)[1]


def first_column(text: str) -> list[str]:
    """Return the names in backquotes in the first column of tables."""
    return [name for row in re.findall(r'^\| (`[^|]*) \|', text, re.MULTILINE)
            for name in re.findall(r'`([^`]+)`', row)]


def code(language: str) -> list[str]:
    """Return the blocks of code in a language."""
    return re.findall(rf'^```{language}\n(.*?)^```', README, re.DOTALL | re.MULTILINE)


def picture() -> np.ndarray:
    """Return a bright rectangle on a dark ground: (90, 120) uint8."""
    gray = np.full((90, 120), 30, np.uint8)
    gray[20:70, 30:90] = 200
    return gray


def test_parameter_tables_are_those_of_the_dataclasses() -> None:
    renewed = runpy.run_path(str(ROOT / 'doc' / 'tables.py'))['renewed']
    assert README == renewed(README), 'run: python3 doc/tables.py'


@pytest.mark.parametrize('name, dtype', [
    ('segments', clouds.SEGMENT_POINT), ('arcs', clouds.ARC), ('planes', clouds.PLANE)])
def test_fields_of_point_clouds(name: str, dtype: np.dtype) -> None:
    """Names, types and offsets are in the order of the message, the size is its size."""
    table = re.search(rf'<!-- fields of {name} -->\n((\|.*\n)+)', README)[1]
    assert re.findall(r'^\| `(\w+)` \| (\w+) \| (\d+) \|', table, re.MULTILINE) == [
        (field, TYPES[kind.str[1:]], str(offset))
        for field, (kind, offset) in dtype.fields.items()]
    assert f'**Fields of `~/{name}`** ({dtype.itemsize} bytes' in README


def test_every_topic_is_listed() -> None:
    assert first_column(section('Published'))[:len(OUTPUTS) + 1] == [
        *(output.topic for output in OUTPUTS), '/diagnostics']


def test_every_encoding_is_listed() -> None:
    table = re.search(r'Encodings:\n\n((\|.*\n)+)', README)[1]
    listed = re.findall(r'`(\w+)`', table)
    assert sorted(listed) == sorted(LAYOUTS)


def test_every_key_of_diagnostics_is_listed() -> None:
    status = DiagnosticStatus()
    Statistics().report(status, True, 0.0)
    listed = first_column(section('Diagnostics'))
    assert [name for name in listed if 'REASON' not in name] == [
        value.key for value in status.values]


def test_every_key_of_the_lens_is_listed() -> None:
    gray = Scene(640, 480, lam=-0.4).image(400)
    camera, settings = CameraLens(), Settings()
    camera.follow(Detector().detect(gray), gray.shape, settings)
    table = re.search(r'<!-- keys of lens -->\n((\|.*\n)+)', README)[1]
    assert first_column(table) == list(camera.values(settings))


def test_snippets_in_python_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They come one after the other: messages, then the library."""
    monkeypatch.chdir(tmp_path)
    gray = picture()
    cv2.imwrite('photo.jpg', gray, [cv2.IMWRITE_JPEG_QUALITY, 100])
    arcs = Detector().detect(gray)
    lens, messages, library, scene = code('python')
    scope: dict[str, Any] = {'segments_message': clouds.segments(Header(), arcs, 0.1),
                             'arcs_message': clouds.arc_records(Header(), arcs)}
    exec(compile(messages, 'README.md', 'exec'), scope)
    assert len(scope['segments']) == len(scope['arcs']) == len(arcs)
    assert 0 < len(scope['long']) <= len(arcs)
    exec(compile(lens, 'README.md', 'exec'), scope)
    assert scope['lens'] is None  # of one rectangle
    cv2.imwrite('photo.jpg', Scene(640, 480, lam=-0.4).image(400))
    exec(compile(lens, 'README.md', 'exec'), scope)
    assert len(scope['straight']) == len(scope['segments']) == len(scope['arcs']) > 50
    cv2.imwrite('photo.jpg', gray, [cv2.IMWRITE_JPEG_QUALITY, 100])
    scope = {}
    exec(compile(library, 'README.md', 'exec'), scope)
    assert len(scope['straight']) == len(scope['arcs']) >= 4
    scope = {}
    exec(compile(scene, 'README.md', 'exec'), scope)
    assert scope['image'].shape == (480, 640) and len(scope['truth'])


def test_code_in_a_line_runs() -> None:
    """Whatever is written as an expression or import of this package between backquotes."""
    plain = re.sub(r'^```.*?^```', '', README, flags=re.DOTALL | re.MULTILINE)
    for text in re.findall(r'`([^`\n]*qflsd_ros\.[^`\n]*\(.*?)`', plain):
        exec(text, {})
    for module in re.findall(r'`(qflsd_ros(?:\.\w+)+)`', plain):
        importlib.import_module(module)


def test_image_proc_is_remapped_to_the_camera_info_of_the_detector() -> None:
    """Its node takes camera_info beside the resolved name of image, which is then remapped."""
    command = re.search(r'^ +ros2 run image_proc rectify_node (.*)$', README, re.MULTILINE)[1]
    context = Context()
    rclpy.init(args=command.split(), context=context)
    try:
        node = Node('rectify_node', context=context)
        image = node.resolve_topic_name('image')
        assert image == '/cam/image_raw'
        assert node.resolve_topic_name(calibration_topic(image)) == '/detector/camera_info'
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)


def test_links_lead_somewhere() -> None:
    """Files exist, and so do headings."""
    anchors = {re.sub(r'[^\w -]', '', title.lower()).replace(' ', '-')
               for title in re.findall(r'^#+ (.*)$', README, re.MULTILINE)}
    for target in re.findall(r'\]\(([^)]+)\)', README):
        assert target[1:] in anchors if target[0] == '#' else (ROOT / target).exists(), target
