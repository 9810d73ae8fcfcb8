"""Parameters of the command ``detect``, from its flags and from parameter files of the node."""
from __future__ import annotations

import argparse
import dataclasses
import difflib
from pathlib import Path
import re
from typing import Any, Callable, NamedTuple

from qflsd_ros.core import Parameters
from qflsd_ros.ros.input.region import read_mask
from qflsd_ros.ros.parameters import file, origin
from qflsd_ros.ros.parameters.file import FileError
from qflsd_ros.ros.parameters.node_parameters import check_together, Settings
from qflsd_ros.sources.frames import SourceError

NODE = '/detector'
# Parameters of the node that concern topics, messages and diagnostics: no effect here.
IDLE = ('image_transport', 'max_pixels', 'marker_colour', 'metres_per_pixel', 'max_bend',
        'line_features_rate', 'line_features_max', 'line_features_min_length', 'cameras',
        'camera_index', 'max_age', 'hardware_id')
# Parameters that rclpy declares for every node.
OF_ROS = ('use_sim_time', 'start_type_description_service', 'qos_overrides')
FIELDS = {field.name: field for kind in (Parameters, Settings)
          for field in dataclasses.fields(kind)}
NAME = re.compile(r'(/[A-Za-z_]\w*)+')  # of a node, with its namespaces


class SettingsError(Exception):
    """A parameter or argument has an invalid value; the text names both and the valid values."""


class Options(NamedTuple):
    """Parameters of the detector, and those of the node that affect its results."""

    detector: Parameters
    node: Settings

    def values(self) -> dict[str, Any]:
        """Return the values of all parameters that have an effect here, by name."""
        both = dataclasses.asdict(self.detector) | dataclasses.asdict(self.node)
        return {name: value for name, value in both.items() if name not in IDLE}


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add a flag for every parameter that has an effect here, with the name of the parameter."""
    group = parser.add_argument_group('parameters')
    for name, field in FIELDS.items():
        if name in IDLE:
            continue
        meta = field.metadata
        limits = f'{meta["low"]} to {meta["high"]} {meta["unit"]}'.rstrip() + '; '
        text = f'{meta["description"]} ({limits * (meta["low"] is not None)}' \
               f'default: {field.default})'
        group.add_argument(f'--{name}', metavar='VALUE', default=argparse.SUPPRESS,
                           type=truth if type(field.default) is bool else type(field.default),
                           choices=meta['choices'] or None, help=text.replace('%', '%%'))


def truth(text: str) -> bool:
    """Return the value of a flag that is true or false; raise ValueError for any other text."""
    if text not in ('true', 'false'):
        raise ValueError
    return text == 'true'


def read(arguments: argparse.Namespace, tell: Callable[[str], None]) -> Options:
    """
    Return the parameters: flags override the file ``params``, which overrides the defaults.

    ``tell`` is called with a line of text for each parameter in the file that has no effect.

    Raises
    ------
    SettingsError
        The file cannot be read, a value is invalid, or two values contradict each other.

    """
    values = _from_file(arguments.params, arguments.node, tell) if arguments.params else {}
    values |= {name: value for name, value in vars(arguments).items() if name in FIELDS}
    try:
        options = Options(Parameters(**_of(Parameters, values)),
                          Settings(**_of(Settings, values)))
        check_together(*options)
        if options.node.mask:
            read_mask(options.node.mask)
    except SourceError as error:
        raise SettingsError(f'mask {error}') from error
    except (TypeError, ValueError) as error:
        place = origin.origin(str(error), ['--params-file', str(arguments.params)])
        raise SettingsError(f'{error}{place}') from error
    return options


def _of(kind: type[Parameters] | type[Settings], values: dict[str, Any]) -> dict[str, Any]:
    """Return those values that are fields of a dataclass."""
    return {field.name: values[field.name] for field in dataclasses.fields(kind)
            if field.name in values}


def _from_file(path: Path, node: str, tell: Callable[[str], None]) -> dict[str, Any]:
    """Return the parameters of a node in a ROS parameter file, by name."""
    if not NAME.fullmatch(node):
        raise SettingsError(f'--node is {node!r}: must be the full name of a node, as '
                            '/left/detector')
    try:
        sections = file.read(path)
    except FileError as error:
        raise SettingsError(str(error)) from error
    found = file.merged(sections, node)
    if found is None:
        tell(f'{file.unmatched(path, sections, node)}; --node names another node')
        return {}
    idle = [name for name, value in found.values.items() if _is_idle(name, value)]
    if idle:
        tell(f'{path}: parameters without effect here: {", ".join(idle)}')
    for name in found.values:
        if name not in FIELDS and name not in idle:
            near = difflib.get_close_matches(name, FIELDS, 1, 0.5)
            hint = f': did you mean {near[0]}?' if near else ''
            tell(f'{path}, line {found.lines[name]}: there is no parameter {name}, it is '
                 f'ignored{hint}')
    return found.values


def _is_idle(name: str, value: Any) -> bool:
    """Return whether a parameter differs from its default although it has no effect here."""
    if name in IDLE:
        return bool(value != FIELDS[name].default)
    return name.split('.')[0] in OF_ROS
