"""Errors name the lines of parameter files that set a parameter."""
from __future__ import annotations

from pathlib import Path

import pytest
from qflsd_ros.ros.parameters.origin import origin

TEXT = """\
/**:
  ros__parameters:
    min_length: 20.0   # tolerance
    qos_overrides: {/image: {subscription: {depth: deep}}}
/left/detector: {ros__parameters: {tolerance: wide,
                                   line_width: 2}}
"""


@pytest.mark.parametrize('error, lines', [
    ('tolerance is wide: must be a number', [5]),
    ('min_length is 20.0: must not exceed tolerance.', [3, 5]),
    ("Trying to set 'qos_overrides./image.subscription.depth' to 'deep'", [4]),
    ('min_length_of_all is bad, so is my.tolerance', []),
])
def test_lines_are_named(tmp_path: Path, error: str, lines: list[int]) -> None:
    file = tmp_path / 'p.yaml'
    file.write_text(TEXT)
    said = origin(error, ['detector', '--ros-args', '--params-file', str(file)])
    places = '; '.join(f'{file}, line {line}' for line in lines)
    assert said == (f' ({places})' if places else '')


def test_every_file_is_looked_at(tmp_path: Path) -> None:
    arguments = ['--ros-args']
    for name in ('a', 'b'):
        (tmp_path / name).write_text(TEXT)
        arguments += ['--params-file', str(tmp_path / name)]
    assert origin('line_width is 2', arguments) == \
        f' ({tmp_path}/a, line 6; {tmp_path}/b, line 6)'


@pytest.mark.parametrize('content', [b'', b'- 1', b'[', b'\xff\xfe\x00', b'{1: {2: 3}}', b'"',
                                     b'/**: {ros__parameters: &a {tolerance: 1, b: *a}}'])
def test_what_is_no_parameter_file_says_nothing(tmp_path: Path, content: bytes) -> None:
    (tmp_path / 'p').write_bytes(content)
    assert origin('tolerance', ['--params-file', str(tmp_path / 'p')]) == ''
    assert origin('tolerance', ['--params-file', 'nowhere', '--params-file']) == ''
