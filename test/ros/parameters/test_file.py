"""Parameter files are interpreted as by rcl."""
from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from qflsd_ros.ros.parameters.file import FileError, merged, read
import rclpy
from rclpy.context import Context
from rclpy.node import Node

NAMES = [
    ['/detector', '/**'], ['/**', '/detector'], ['detector', '/**'], ['/**/detector', '/detector'],
    ['/*', '/detector'], ['/detector', '/*'], ['/**', '/*/detector', '/**/detector'],
    ['/*/detector'], ['/**/*'], ['/left/*'], ['/left/**'], ['left/detector'], ['*'], ['**'],
    ['/*/*'], ['/**/left/detector'], ['/left/**/detector'], ['detector', '/detector'], ['camera'],
    ['/**/left/**'], ['*/detector'], ['/**/b/detector'], ['/a/*/detector'], ['/a/**/b/**']]
VALUES = [
    '1e3', '0x1F', '010', '1_000', 'yes', 'off', 'y', '~', 'null', '2001-01-01', '1:30', '.5',
    '5.', '.inf', '-.inf', '+.INF', 'nan', 'inf', '-Infinity', '-.nan', '!!str 5', '!!float 5',
    '"5"', '1.0e+999', '1e-400', '99999999999999999999', '[1, 2]', '{a: 1}', '', '+5', '08', '0',
    '-0', '-010', '0o17', '1.5f', "'off'", 'tRUE', '!!int "5"', '.', '9223372036854775808', "''",
    '!x 5', '1 2', '0x', '[a, b]']
LAYOUTS = [
    'left:\n  detector:\n    ros__parameters: {t: 1}\n', '', '/**: 1', '/**: {}', '- 1', 'a: 1',
    '/**:\n  detector:\n    ros__parameters: {t: 1}\n', '/**:\n', 'ros__parameters: {t: 1}',
    '/**:\n  ros__parameters:\n', '/**:\n  tolerance: 1', '/**:\n  ros__parameters: {"": 1}',
    '/**:\n  ros__parameters: {t: 1}\n/**:\n  ros__parameters: {t: 2}\n',
    '/**:\n  ros__parameters: {t: 1, t: 2}\n', '{"/**": {ros__parameters: {<<: {t: 1}}}}',
    '/**:\n  ros__parameters: {t: 1}\n---\n/**:\n  ros__parameters: {t: 2}\n',
    '/**:\n  ros__parameters: {a.b: 1, c: {d: 2}}', '/**:\n  ros__parameters: {1: 1}',
    'a:\n  b:\n    detector:\n      ros__parameters: {t: 1}\n/**:\n  ros__parameters: {t: 3}\n']


def of_rcl(path: Path, namespace: str, domain: int) -> dict[str, Any] | None:
    """Return the values that a node gets from a file; None if rcl refuses the file."""
    context = Context()
    try:
        rclpy.init(args=['x', '--ros-args', '--params-file', str(path)], context=context,
                   domain_id=domain)
        node = Node('detector', namespace=namespace, context=context, enable_rosout=False,
                    start_parameter_services=False)
        values = {name: value.value for name, value in node._parameter_overrides.items()}
        node.destroy_node()
        return values
    except RuntimeError:
        return None
    finally:
        context.try_shutdown()


@pytest.mark.parametrize('text', LAYOUTS + [
    f'/**:\n  ros__parameters:\n    t: {value}\n' for value in VALUES] + [
    ''.join(f"'{name}':\n  ros__parameters: {{t: {i}}}\n" for i, name in enumerate(names))
    for names in NAMES])
def test_a_file_means_the_same_to_rcl(tmp_path: Path, domain: int, text: str) -> None:
    path = tmp_path / 'p.yaml'
    path.write_text(text)
    for namespace in ('', '/left', '/a/b'):
        try:
            found = merged(read(path), f'{namespace}/detector')
            ours = found.values if found else {}
        except FileError:
            ours = None
        # As text: nan is not equal to itself, and 1 is not 1.0 here.
        assert repr(ours) == repr(of_rcl(path, namespace, domain))
