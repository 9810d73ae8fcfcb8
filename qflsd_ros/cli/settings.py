"""The detector's parameters from the command line and from a ROS parameter file."""
from __future__ import annotations

import argparse
import dataclasses
import difflib
from pathlib import Path
from typing import Any

from qflsd_ros.core import Parameters
from qflsd_ros.ros.node_parameters import NodeParameters
from qflsd_ros.ros.parameter_file import Loader

FIELDS = {field.name: field for field in dataclasses.fields(Parameters)}
# A parameter file of the node is welcome: what it says of the node alone is left aside.
NODE_FIELDS = {field.name for field in dataclasses.fields(NodeParameters)} | {
    'qos_overrides', 'start_type_description_service', 'use_sim_time'}
NODE_NAMES = ('/**', 'detector', '/detector', '/**/detector')  # a file may speak of other nodes


class SettingsError(Exception):
    """A parameter that cannot be used; the text names it and what would be right."""


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add a flag for every field of :class:`Parameters`, called like it."""
    group = parser.add_argument_group('parameters of the detector')
    for name, field in FIELDS.items():
        meta = field.metadata
        limits = f'{meta["low"]} to {meta["high"]} {meta["unit"]}'.rstrip() + '; '
        text = f'{meta["description"]} ({limits * (meta["low"] is not None)}' \
               f'default: {field.default})'
        group.add_argument(f'--{name}', type=type(field.default), metavar='VALUE',
                           choices=meta['choices'] or None, default=argparse.SUPPRESS,
                           help=text.replace('%', '%%'))


def read(arguments: argparse.Namespace) -> Parameters:
    """
    Return the parameters: defaults, then those of the file ``params``, then those of the flags.

    Raises
    ------
    SettingsError
        The file cannot be read or holds an unknown parameter, or a value cannot be used.

    """
    values = _from_file(arguments.params) if arguments.params else {}
    values.update((name, value) for name, value in vars(arguments).items() if name in FIELDS)
    try:
        return Parameters(**values)
    except (TypeError, ValueError) as error:
        raise SettingsError(str(error)) from error


def _from_file(path: Path) -> dict[str, Any]:
    """Return the detector's own parameters of a ROS parameter file; those of the node are left."""
    values: dict[str, Any] = {}
    for section in _sections(path):
        for name, value in section.items():
            if name in FIELDS:
                values[name] = value
            elif name not in NODE_FIELDS:
                nearest = difflib.get_close_matches(str(name), FIELDS, 1, 0)[0]
                raise SettingsError(f'{path}: there is no parameter {name!r}; '
                                    f'the nearest one is {nearest}')
    return values


def _sections(path: Path) -> list[dict[str, Any]]:
    """Return what a ROS parameter file says of the detector, section by section."""
    try:
        nodes = Loader(path.read_text(encoding='utf-8')).get_single_data()
    except Exception as error:  # A tag on what it does not fit raises anything: !!bool 3.
        what = ' '.join(str(error).split()) or type(error).__name__
        raise SettingsError(f'{path}: cannot be read: {what}') from error
    layout = SettingsError(f'{path}: must have the layout of a ROS parameter file: '
                           '"/**:", below it "ros__parameters:", below that "name: value" lines')
    if not isinstance(nodes, dict):
        raise layout
    sections = []
    for name in NODE_NAMES:
        if name in nodes:
            node = nodes[name]
            section = node.get('ros__parameters') if isinstance(node, dict) else None
            if not isinstance(section, dict):
                raise layout
            sections.append(section)
    if not sections:
        raise layout
    return sections
