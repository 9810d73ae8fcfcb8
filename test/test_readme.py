"""What the README says of parameters, topics and the Python library is so."""
from __future__ import annotations

from pathlib import Path
import re
import runpy
import shutil
import subprocess
from typing import Any

import cv2
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import pytest
from qflsd_ros.core import Detector
from qflsd_ros.ros import outputs
from qflsd_ros.ros.detector import OUTPUTS
from qflsd_ros.ros.diagnostics import Statistics
from qflsd_ros.ros.images import LAYOUTS
from qflsd_ros.ros.lens import CameraLens
from qflsd_ros.ros.node_parameters import NodeParameters
from qflsd_ros.sources import Scene
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
    ('segments', outputs.SEGMENT_POINT), ('arcs', outputs.ARC), ('planes', outputs.PLANE)])
def test_fields_of_point_clouds(name: str, dtype: np.dtype) -> None:
    """Names, types and offsets are in the order of the message, the size is its size."""
    table = re.search(rf'<!-- fields of {name} -->\n((\|.*\n)+)', README)[1]
    assert re.findall(r'^\| `(\w+)` \| (\w+) \| (\d+) \|', table, re.MULTILINE) == [
        (field, TYPES[kind.str[1:]], str(offset))
        for field, (kind, offset) in dtype.fields.items()]
    assert f'**Fields of `~/{name}`** ({dtype.itemsize} bytes' in README


def test_every_topic_is_listed() -> None:
    assert first_column(section('Published'))[:len(OUTPUTS) + 2] == [
        *(topic for topic, _, _ in OUTPUTS), '~/planes', '/diagnostics']


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
    camera, settings = CameraLens(), NodeParameters()
    camera.follow(Detector().detect(gray), gray.shape, settings)
    table = re.search(r'<!-- keys of lens -->\n((\|.*\n)+)', README)[1]
    assert first_column(table) == list(camera.values(settings))


def test_snippets_in_python_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They come one after the other: messages, then the library."""
    monkeypatch.chdir(tmp_path)
    gray = picture()
    cv2.imwrite('photo.jpg', gray, [cv2.IMWRITE_JPEG_QUALITY, 100])
    arcs = Detector().detect(gray)
    lens, messages, library = code('python')
    scope: dict[str, Any] = {'segments_message': outputs.segments(Header(), arcs, 0.1),
                             'arcs_message': outputs.arc_records(Header(), arcs)}
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


def test_links_lead_somewhere() -> None:
    """Files exist, and so do headings."""
    anchors = {re.sub(r'[^\w -]', '', title.lower()).replace(' ', '-')
               for title in re.findall(r'^#+ (.*)$', README, re.MULTILINE)}
    for target in re.findall(r'\]\(([^)]+)\)', README):
        assert target[1:] in anchors if target[0] == '#' else (ROOT / target).exists(), target


STUBS = {
    'sensor_msgs/msg/point_cloud2.hpp': '''
#include <cstdint>
#include <vector>
namespace sensor_msgs::msg {
struct Point {float x, y; std::uint32_t segment;};
struct PointCloud2 {std::vector<Point> points;};
}
''',
    'sensor_msgs/point_cloud2_iterator.hpp': '''
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
'''}
MAIN = '''
#include <iostream>
int main()
{
  sensor_msgs::msg::PointCloud2 message{{
    {1, 2, 1}, {3, 4, 1}, {5, 6, 4}, {7, 8, 4}, {9, 10, 4}, {11, 12, 5}, {13, 14, 5}}};
  for (const auto & line : polylines(message)) {std::cout << line.size() << " ";}
}
'''


@pytest.mark.skipif(shutil.which('g++') is None, reason='there is no C++ compiler')
def test_cpp_example_reads_segments_with_missing_numbers(tmp_path: Path) -> None:
    """~/rectified leaves numbers out: 1, 4 and 5 are three polylines."""
    code = re.search(r'```cpp\n(.*?)```', README, re.DOTALL).group(1)
    for name, content in STUBS.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
    (tmp_path / 'main.cpp').write_text(code + MAIN)
    subprocess.run(['g++', '-std=c++17', '-I', tmp_path, tmp_path / 'main.cpp', '-o',
                    tmp_path / 'main'], check=True)
    assert subprocess.run([tmp_path / 'main'], check=True, capture_output=True,
                          text=True).stdout == '2 3 2 '
