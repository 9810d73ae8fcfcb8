"""
Declaration of the fields of dataclasses as ROS parameters.

The dataclasses consist of :func:`qflsd_ros.core.parameters.parameter` fields.  Run as a module,
this file prints ``config/detector.yaml``.
"""
from __future__ import annotations

import dataclasses
import difflib
import json
import sys
from typing import Any, Callable, Iterable, Mapping, Sequence

from qflsd_ros.core.parameters import meant, Parameters
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.ros.parameters.origin import unmatched
from rcl_interfaces.msg import (
    FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult)
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
import yaml

YAML_HEAD = """\
# Every parameter of the detector with its default. Load a copy of this file with
#   ros2 run qflsd_ros detector --ros-args --params-file detector.yaml
/**:
  ros__parameters:
"""


class ParameterError(Exception):
    """A parameter given at start cannot be used; the text names it and the values allowed."""


def descriptor(field: dataclasses.Field[Any]) -> ParameterDescriptor:
    """Return the ROS descriptor of a field: description, unit, range, choices, read-only."""
    meta = field.metadata
    unit = f' Unit: {meta["unit"]}.' if meta['unit'] else ''
    result = ParameterDescriptor(
        name=field.name, description=meta['description'] + unit, read_only=meta['read_only'])
    if meta['choices']:
        result.additional_constraints = f'One of: {", ".join(meta["choices"])}.'
    if isinstance(field.default, float) and meta['low'] is not None:
        result.floating_point_range = [
            FloatingPointRange(from_value=meta['low'], to_value=meta['high'], step=0.0)]
    if isinstance(field.default, int) and meta['low'] is not None:
        result.integer_range = [
            IntegerRange(from_value=meta['low'], to_value=meta['high'], step=1)]
    return result


def attach(node: Node, kinds: Sequence[type], apply: Callable[..., None],
           check: Callable[..., None] = lambda *_: None) -> None:
    """
    Declare the fields of dataclasses as parameters of a node, and apply every change of them.

    Values that are set together are checked together, and either all applied or all refused with
    a reason.  An integer is accepted for a floating-point number.

    Parameters
    ----------
    node
        The node that declares the parameters.
    kinds
        Dataclasses made of ``parameter()`` fields.
    apply
        Called with one instance of each of ``kinds``, now and after every change.
    check
        Called with the same instances before; raises ValueError if they contradict each other.

    Raises
    ------
    ParameterError
        A value from the command line or a YAML file cannot be used.

    """
    try:
        current = _replaced([kind() for kind in kinds], _given(node))
        check(*current)
    except (TypeError, ValueError) as error:
        raise ParameterError(f'parameter {error}') from error
    for settings in current:
        for field in dataclasses.fields(settings):
            node.declare_parameter(field.name, getattr(settings, field.name), descriptor(field),
                                   ignore_override=True)

    def widen(changes: list[RosParameter]) -> list[RosParameter]:
        return [_widened(change, kinds) for change in changes]

    def validate(changes: list[RosParameter]) -> SetParametersResult:
        try:
            check(*_replaced(current, _values(changes)))
        except (TypeError, ValueError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def follow(changes: list[RosParameter]) -> None:
        current[:] = _replaced(current, _values(changes))
        apply(*current)

    node.add_pre_set_parameters_callback(widen)
    node.add_on_set_parameters_callback(validate)
    node.add_post_set_parameters_callback(follow)
    apply(*current)


def warn_of_unknown(node: Node, siblings: Sequence[str] = ()) -> None:
    """
    Warn of values given at start for unknown parameters, and of files for other nodes.

    Files for one of ``siblings``, full names of nodes of this process, are right as well.
    """
    for line in unmatched(sys.argv, node.get_fully_qualified_name(), siblings):
        node.get_logger().warning(line)
    known = node.list_parameters([], 0).names
    for name in _given(node):
        if name not in known:
            near = difflib.get_close_matches(name, known, 1, 0.5)
            hint = f': did you mean {near[0]}?' if near else ''
            node.get_logger().warning(f'there is no parameter {name}, it is ignored{hint}')


def yaml_text(kinds: Iterable[type] = (Parameters, Settings)) -> str:
    """Return a parameter file with every field at its default, each below a comment line."""
    return YAML_HEAD + ''.join(
        f'    # {field.metadata["description"]}{_bracketed(_allowed(field))}\n'
        f'    {yaml.safe_dump({field.name: field.default})}'
        for kind in kinds for field in dataclasses.fields(kind))


def markdown_table(kinds: Iterable[type] = (Parameters, Settings)) -> str:
    """Return a table with a row for each field: name, default, range with unit, description."""
    rows = [
        f'| `{field.name}` | `{json.dumps(field.default)}` | {_allowed(field)} '
        f'| {field.metadata["description"]} |'
        for kind in kinds for field in dataclasses.fields(kind)]
    return '\n'.join(['| parameter | default | range | meaning |', '|---|---|---|---|', *rows])


def _bracketed(text: str) -> str:
    return f' [{text}]' if text else ''


def _allowed(field: dataclasses.Field[Any]) -> str:
    """Return the range of a field and its unit; an empty text for a field without a range."""
    meta = field.metadata
    if meta['low'] is None:
        return ''
    return f'{meta["low"]} to {meta["high"]} {meta["unit"]}'.rstrip()


def _given(node: Node) -> dict[str, Any]:
    """Return the values given at start by the command line and by files, declared or not."""
    # rclpy has no public access to them.
    return _values(node._parameter_overrides.values())


def _values(changes: Iterable[RosParameter]) -> dict[str, Any]:
    return {change.name: change.value for change in changes}


def _replaced(current: Sequence[Any], values: Mapping[str, Any]) -> list[Any]:
    """Return instances of dataclasses with some fields replaced; they check themselves."""
    return [dataclasses.replace(settings, **{
        field.name: values[field.name] for field in dataclasses.fields(settings)
        if field.name in values}) for settings in current]


def _widened(change: RosParameter, kinds: Sequence[type]) -> RosParameter:
    """Return a change with its value in the type of the field, if that loses nothing."""
    for field in (field for kind in kinds for field in dataclasses.fields(kind)):
        value = meant(field, change.value)
        if field.name == change.name and type(value) is not type(change.value):
            return RosParameter(change.name, value=value)
    return change


if __name__ == '__main__':
    print(yaml_text(), end='')
