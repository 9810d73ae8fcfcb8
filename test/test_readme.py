"""What README and the documents say of parameters, topics and the Python library is so."""
from __future__ import annotations

from pathlib import Path
import pkgutil
import re
import runpy
import shutil
import subprocess
import sys
from typing import Any

import cv2
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import pytest
from qflsd_ros.cli.demo import free_domain
from qflsd_ros.core import Detector, Tracker
from qflsd_ros.records import LINE
from qflsd_ros.ros.diagnostics import Statistics
from qflsd_ros.ros.input.images import LAYOUTS
from qflsd_ros.ros.input.subscriptions import calibration_topic
from qflsd_ros.ros.lens import CameraLens
from qflsd_ros.ros.output import clouds
from qflsd_ros.ros.output.topics import OUTPUTS
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.ros.tracks import TrackStatistics
from qflsd_ros.sources import Scene
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import Header

ROOT = Path(__file__).parents[1]
README = (ROOT / 'README.md').read_text()
MESSAGES = (ROOT / 'doc' / 'messages.md').read_text()
LENS = (ROOT / 'doc' / 'lens.md').read_text()
MAPPING = (ROOT / 'doc' / 'mapping.md').read_text()
CAMERA = (ROOT / 'doc' / 'camera.md').read_text()
TROUBLE = (ROOT / 'doc' / 'troubleshooting.md').read_text()
CONTRIBUTING = (ROOT / 'CONTRIBUTING.md').read_text()
DOCUMENTS = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', ROOT / 'benchmark' / 'README.md',
             *sorted((ROOT / 'doc').glob('*.md'))]
MOST_BYTES = 12000      # of the README
TO_COME = {'core/tracking/'}    # what the recipes propose
TABLES = runpy.run_path(str(ROOT / 'doc' / 'tables.py'))
TYPES = {'f4': 'float32', 'i4': 'int32', 'u4': 'uint32'}

each_document = pytest.mark.parametrize('document', DOCUMENTS, ids=lambda path: path.name)


def section(text: str, title: str) -> str:
    """Return the part of a document below a heading, up to the next one of any depth."""
    return re.search(rf'^#+ {title}\n(.*?)(?=^#|\Z)', text, re.DOTALL | re.MULTILINE)[1]


def first_column(text: str) -> list[str]:
    """Return the names in backquotes in the first column of tables."""
    return [name for row in re.findall(r'^\| (`[^|]*) \|', text, re.MULTILINE)
            for name in re.findall(r'`([^`]+)`', row)]


def snippet(text: str) -> str:
    """Return the one block of Python in a document."""
    found, = re.findall(r'^```python\n(.*?)^```', text, re.DOTALL | re.MULTILINE)
    return found


def prose(text: str) -> str:
    """Return a document without its blocks of code."""
    return re.sub(r'^```.*?^```', '', text, flags=re.DOTALL | re.MULTILINE)


def anchors(text: str) -> set[str]:
    """Return the anchors that GitHub gives to the headings of a document."""
    return {re.sub(r'[^\w -]', '', title.lower()).replace(' ', '-')
            for title in re.findall(r'^#+ (.*)$', prose(text), re.MULTILINE)}


def picture() -> np.ndarray:
    """Return a bright rectangle on a dark ground: (90, 120) uint8."""
    gray = np.full((90, 120), 30, np.uint8)
    gray[20:70, 30:90] = 200
    return gray


def test_the_readme_is_short() -> None:
    assert len(README.encode()) <= MOST_BYTES


@pytest.mark.parametrize('document', TABLES['TABLES'])
def test_generated_tables_are_those_of_the_code(document: str) -> None:
    text = (ROOT / 'doc' / document).read_text()
    assert text == TABLES['renewed'](document), 'run: python3 -m doc.tables'


@pytest.mark.parametrize('name, dtype', [
    ('segments', clouds.SEGMENT_POINT), ('arcs', clouds.ARC), ('planes', clouds.PLANE),
    ('lines', LINE)])
def test_fields_of_point_clouds(name: str, dtype: np.dtype) -> None:
    """Names, types and offsets are in the order of the message, the size is its size."""
    document = MAPPING if name == 'lines' else MESSAGES
    table = re.search(rf'<!-- fields of {name} -->\n((\|.*\n)+)', document)[1]
    assert re.findall(r'^\| `(\w+)` \| (\w+) \| (\d+) \|', table, re.MULTILINE) == [
        (field, TYPES[kind.str[1:]], str(offset))
        for field, (kind, offset) in dtype.fields.items()]
    assert f'**Fields of `~/{name}`** ({dtype.itemsize} bytes' in document


def test_every_topic_is_listed() -> None:
    """In the README once, and each result with a section of its own among the messages."""
    table = section(README, 'Topics')
    read = re.findall(r'^\| `([^`]+)` \(subscribed', table, re.MULTILINE)
    written = re.findall(r'^\| `([^`]+)` \|', table, re.MULTILINE)
    results = [output.topic for output in OUTPUTS]
    assert read == ['image', 'image/compressed', 'camera_info']
    assert written == [*results, '/diagnostics']
    assert set(re.findall('^## Topic `(.*)`$', MESSAGES, re.MULTILINE)) == set(results)


def test_every_encoding_is_listed() -> None:
    table = re.search(r'^((\|.*\n)+)', section(MESSAGES, 'Encodings'), re.MULTILINE)[1]
    listed = re.findall(r'`(\w+)`', table)
    assert sorted(listed) == sorted(LAYOUTS)


def test_every_key_of_diagnostics_is_listed() -> None:
    status = DiagnosticStatus()
    Statistics().report(status, True, 0.0)
    tracks = TrackStatistics()
    tracks.follow(Tracker().track(picture()))
    listed = first_column(section(TROUBLE, 'Diagnostics'))
    assert [name for name in listed if 'REASON' not in name] == [
        *(value.key for value in status.values), *tracks.take()]


def test_every_key_of_the_lens_is_listed() -> None:
    gray = Scene(640, 480, lam=-0.4).image(400)
    camera, settings = CameraLens(), Settings()
    camera.follow(Detector().detect(gray), gray.shape, settings)
    table = re.search(r'<!-- keys of lens -->\n((\|.*\n)+)', LENS)[1]
    assert first_column(table) == list(camera.values(settings))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the current folder, with a photograph of a rectangle as snippets read it."""
    monkeypatch.chdir(tmp_path)
    photograph(picture())
    return tmp_path


def photograph(gray: np.ndarray) -> None:
    cv2.imwrite('photo.jpg', gray, [cv2.IMWRITE_JPEG_QUALITY, 100])


def executed(document: str, scope: dict[str, Any]) -> dict[str, Any]:
    """Return the names after a run of the snippet of a document."""
    exec(compile(snippet(document), 'snippet', 'exec'), scope)
    return scope


def test_the_snippet_on_messages_runs() -> None:
    arcs = Detector().detect(picture())
    scope = executed(section(MESSAGES, 'Reading the messages'), {
        'segments_message': clouds.segments(Header(), arcs, 0.1),
        'arcs_message': clouds.arc_records(Header(), arcs)})
    assert len(scope['segments']) == len(scope['arcs']) == len(arcs)
    assert 0 < len(scope['long']) <= len(arcs)


def test_the_snippet_on_the_lens_runs(folder: Path) -> None:
    assert executed(LENS, {})['lens'] is None  # of one rectangle
    photograph(Scene(640, 480, lam=-0.4).image(400))
    scope = executed(LENS, {})
    assert len(scope['straight']) == len(scope['segments']) == len(scope['arcs']) > 50


def test_the_snippet_on_the_library_runs(folder: Path) -> None:
    scope = executed(README, {})
    assert len(scope['straight']) == len(scope['arcs']) >= 4


def test_the_snippet_on_the_map_runs() -> None:
    scope = executed(MAPPING, {})
    assert len(scope['mapped'].tracks) > 5


def test_the_snippet_on_the_scene_runs() -> None:
    scope = executed(CAMERA, {})
    assert scope['image'].shape == (480, 640) and len(scope['truth'])


@each_document
def test_code_in_a_line_runs(document: Path) -> None:
    """Whatever is written as an expression or name of this package between backquotes."""
    text = prose(document.read_text())
    for expression in re.findall(r'`([^`\n]*qflsd_ros\.[^`\n]*\(.*?)`', text):
        exec(expression, {})
    for name in re.findall(r'`(qflsd_ros(?:\.\w+)+)`', text):
        pkgutil.resolve_name(name)


def test_image_proc_is_remapped_to_the_camera_info_of_the_detector() -> None:
    """Its node takes camera_info beside the resolved name of image, which is then remapped."""
    command = re.search(r'^ +ros2 run image_proc rectify_node (.*)$', LENS, re.MULTILINE)[1]
    context = Context()
    rclpy.init(args=command.split(), context=context, domain_id=free_domain())
    try:
        node = Node('rectify_node', context=context)
        image = node.resolve_topic_name('image')
        assert image == '/cam/image_raw'
        assert node.resolve_topic_name(calibration_topic(image)) == '/detector/camera_info'
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)


@each_document
def test_links_lead_somewhere(document: Path) -> None:
    """Files exist, and so do headings."""
    for target in re.findall(r'\]\((?!https?:)([^)\s]+)\)', prose(document.read_text())):
        path, _, anchor = target.partition('#')
        file = document.parent / path if path else document
        assert file.exists(), target
        assert not anchor or anchor in anchors(file.read_text()), target


def test_files_of_recipes_exist() -> None:
    """Paths in backquotes are those of the tree, or of the package where that has them."""
    recipes = CONTRIBUTING[CONTRIBUTING.index('## Recipes'):]
    paths = re.findall(r'`([\w./-]+(?:\.(?:py|md|xml|yml|txt)|/))`', recipes)
    assert len(paths) > 60
    missing = {path for path in paths
               if not ((ROOT / 'qflsd_ros' / path).exists() or (ROOT / path).exists())}
    assert missing <= TO_COME


STUBS = {
    'sensor_msgs/msg/point_cloud2.hpp': """
#include <cstdint>
#include <vector>
namespace sensor_msgs::msg {
struct Point {float x, y; std::uint32_t segment;};
struct PointCloud2 {std::vector<Point> points;};
}
""",
    'sensor_msgs/point_cloud2_iterator.hpp': """
#include <string>
namespace sensor_msgs {
template<typename T> struct PointCloud2ConstIterator {
  const std::vector<msg::Point> & points; std::string name; std::size_t at = 0; T value{};
  PointCloud2ConstIterator(const msg::PointCloud2 & message, const std::string & field)
  : points(message.points), name(field) {}
  const T & operator*()
  {
    const auto & point = points[at];
    value = name == "x" ? T(point.x) : name == "y" ? T(point.y) : T(point.segment);
    return value;
  }
  PointCloud2ConstIterator & operator++() {++at; return *this;}
  struct End {std::size_t size;};
  End end() const {return {points.size()};}
  bool operator!=(const End & other) const {return at != other.size;}
};
}
"""}
MAIN = """
#include <iostream>
int main()
{
  sensor_msgs::msg::PointCloud2 message{{
    {1, 2, 1}, {3, 4, 1}, {5, 6, 4}, {7, 8, 4}, {9, 10, 4}, {11, 12, 5}, {13, 14, 5}}};
  for (const auto & line : polylines(message)) {std::cout << line.size() << " ";}
}
"""


@pytest.mark.skipif(shutil.which('g++') is None, reason='there is no C++ compiler')
def test_cpp_example_reads_segments_with_missing_numbers(tmp_path: Path) -> None:
    """~/rectified leaves numbers out: 1, 4 and 5 are three polylines."""
    code = re.search(r'```cpp\n(.*?)```', MESSAGES, re.DOTALL).group(1)
    for name, content in STUBS.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
    (tmp_path / 'main.cpp').write_text(code + MAIN)
    subprocess.run(['g++', '-std=c++17', '-I', tmp_path, tmp_path / 'main.cpp', '-o',
                    tmp_path / 'main'], check=True)
    assert subprocess.run([tmp_path / 'main'], check=True, capture_output=True,
                          text=True).stdout == '2 3 2 '


def test_names_in_recipes_exist() -> None:
    """Functions and constants that recipes name are somewhere in the tree."""
    recipes = CONTRIBUTING[CONTRIBUTING.index('## Recipes'):]
    names = set(re.findall(r'`(_[a-z_]+|[A-Z_]{4,}|[A-Z][a-z]+[A-Za-z]*|[a-z]+_[a-z_]+)`',
                           recipes))
    assert len(names) > 10
    folders = ('qflsd_ros', 'benchmark', 'script', 'test')
    tree = '\n'.join(file.read_text() for folder in folders for file in (ROOT / folder).rglob('*')
                     if file.suffix in ('.py', '.sh', '') and file.is_file()
                     and file != Path(__file__))
    for name in names:
        assert re.search(rf'\b{name}\b', tree), name


def test_there_are_recipes_for_the_commonest_changes() -> None:
    assert len(re.findall('^### ', CONTRIBUTING, re.MULTILINE)) >= 15


def test_modules_of_the_design_exist() -> None:
    design = (ROOT / 'doc' / 'design.md').read_text()
    folders = 'core|ros|detection|lens|geometry|attitude|tracking'
    paths = set(re.findall(rf'`((?:{folders})/[\w/]+\.py)`', design))
    assert len(paths) > 15
    for path in paths - TO_COME:
        assert any((ROOT / 'qflsd_ros' / part / path).exists() for part in ('', 'core')), path


@each_document
def test_options_of_scripts_exist(document: Path) -> None:
    """What is said of script/demo and of the command detect is what they take."""
    said = set(re.findall(r'^    detect .*?(--\w+)', document.read_text(), re.MULTILINE))
    if said:
        usage = subprocess.run([sys.executable, '-m', 'qflsd_ros.cli.detect', '--help'],
                               capture_output=True, text=True, check=True).stdout
        assert all(option in usage for option in said)


def test_no_index_is_named_by_its_host() -> None:
    """Indexes of packages have names: PyPI."""
    for document in DOCUMENTS:
        text = document.read_text()
        assert 'pypi.org' not in text and 'break-system-packages' not in text
