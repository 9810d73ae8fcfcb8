"""Dataclasses, config/detector.yaml and declared parameters agree."""
from __future__ import annotations

from dataclasses import fields
import gc
from pathlib import Path
from typing import Any, Iterator

import pytest
from qflsd_ros.core.parameters import Parameters
from qflsd_ros.ros.parameters import declaration
from qflsd_ros.ros.parameters.node_parameters import check_together, Settings
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
import yaml

KINDS = (Parameters, Settings)
FIELDS = [field for kind in KINDS for field in fields(kind)]
YAML_FILE = Path(__file__).parents[3] / 'config' / 'detector.yaml'


class Host(Node):
    """A node with the detector's parameters that remembers what was applied."""

    def __init__(self, context: Context, given: dict[str, Any]) -> None:
        super().__init__('host', context=context, parameter_overrides=[
            RosParameter(name, value=value) for name, value in given.items()])
        self.applied: list[tuple[Parameters, Settings]] = []
        declaration.attach(self, KINDS, lambda *settings: self.applied.append(settings),
                           check_together)

    def change(self, **values: Any) -> str:
        """Set values together; return the reason of a refusal, or nothing."""
        result = self.set_parameters_atomically([
            RosParameter(name, value=value) for name, value in values.items()])
        return '' if result.successful else result.reason


@pytest.fixture
def context(domain: int) -> Iterator[Context]:
    """Give a ROS context without any other process."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    yield context
    context.try_shutdown()
    gc.collect()  # the test's nodes leave the domain now, not at any time later


def test_the_file_in_the_tree_is_the_generated_one() -> None:
    assert YAML_FILE.read_text() == declaration.yaml_text(), \
        'run: python3 -m qflsd_ros.ros.parameters.declaration > config/detector.yaml'


def test_the_file_holds_every_parameter_with_its_default() -> None:
    given = yaml.safe_load(YAML_FILE.read_text())['/**']['ros__parameters']
    assert given == {field.name: field.default for field in FIELDS}
    assert {name: type(value) for name, value in given.items()} == \
        {field.name: type(field.default) for field in FIELDS}


def test_declared_parameters_equal_the_dataclasses(context: Context) -> None:
    host = Host(context, {})
    for field in FIELDS:
        described = host.describe_parameter(field.name)
        assert host.get_parameter(field.name).value == field.default
        assert described.description.startswith(field.metadata['description'])
        assert field.metadata['unit'] in described.description
        assert described.read_only == field.metadata['read_only']
        assert all(choice in described.additional_constraints
                   for choice in field.metadata['choices'])
        ranges = [*described.floating_point_range, *described.integer_range]
        assert [(bounds.from_value, bounds.to_value) for bounds in ranges] == (
            [] if field.metadata['low'] is None
            else [(field.metadata['low'], field.metadata['high'])])
        assert all(bounds.step == 0 for bounds in described.floating_point_range)
    assert host.applied == [(Parameters(), Settings())]


def test_what_is_given_at_start_counts(context: Context) -> None:
    host = Host(context, {'tolerance': 2, 'line_width': 3, 'seed_of_nobody': 1})
    assert host.applied == [(Parameters(tolerance=2.0), Settings(line_width=3))]
    assert host.get_parameter('tolerance').type_ is RosParameter.Type.DOUBLE


@pytest.mark.parametrize('given, texts', [
    ({'tolerance': 99.0}, ['tolerance is 99.0', '0.1 to 10.0 px']),
    ({'tolerance': 'wide'}, ["tolerance is 'wide'", 'float']),
    ({'line_width': 1.5}, ['line_width is 1.5', 'int']),
    ({'image_transport': 'theora'}, ["image_transport is 'theora'", 'raw, compressed']),
    ({'contrast_low': 50.0}, ['contrast_low is 50.0', 'contrast_high']),
    ({'method': 'paper', 'mask': 'm.png'}, ["method is 'paper'", 'mask']),
])
def test_what_cannot_be_used_at_start_is_named(context: Context, given: dict[str, Any],
                                               texts: list[str]) -> None:
    with pytest.raises(declaration.ParameterError) as caught:
        Host(context, given)
    assert all(text in str(caught.value) for text in texts), str(caught.value)
    assert '\n' not in str(caught.value)


def test_changes_are_applied_together_or_not_at_all(context: Context) -> None:
    host = Host(context, {})
    assert host.change(contrast_low=40.0, contrast_high=60.0, line_width=5) == ''
    new = (Parameters(contrast_low=40.0, contrast_high=60.0), Settings(line_width=5))
    assert host.applied[1:] == [new]
    assert 'contrast_low is 70.0' in host.change(contrast_low=70.0, line_width=9)
    assert host.applied[1:] == [new]
    assert host.get_parameter('line_width').value == 5
    # The next change builds on what was applied, not on what was refused.
    assert host.change(max_gap=1.0) == ''
    assert host.applied[-1] == (
        Parameters(contrast_low=40.0, contrast_high=60.0, max_gap=1.0), new[1])


def test_off_is_a_choice_though_yaml_reads_it_as_false(context: Context) -> None:
    host = Host(context, {'lens': False})
    assert host.applied == [(Parameters(), Settings(lens='off'))]
    assert host.change(lens='estimate') == ''
    assert host.change(lens=False) == ''
    assert host.get_parameter('lens').value == 'off'
    assert host.change(lens=True) and host.get_parameter('lens').value == 'off'


def test_an_integer_will_do_for_a_floating_point_number(context: Context) -> None:
    host = Host(context, {})
    assert host.change(tolerance=2) == ''
    assert host.applied[-1][0].tolerance == 2.0
    assert host.get_parameter('tolerance').type_ is RosParameter.Type.DOUBLE


@pytest.mark.parametrize('values, texts', [
    ({'method': 'magic'}, ["method is 'magic'", 'arcs, paper']),
    ({'contrast_high': 2.0}, ['contrast_low is 2.3', 'contrast_high', '2.0']),
    ({'marker_colour': 'mood'}, ["marker_colour is 'mood'", 'track, id, length']),
])
def test_a_refused_change_says_why(context: Context, values: dict[str, Any],
                                   texts: list[str]) -> None:
    host = Host(context, {})
    reason = host.change(**values)
    assert all(text in reason for text in texts), reason
    assert len(host.applied) == 1


@pytest.mark.parametrize('name, value', [
    ('tolerance', 99.0), ('tolerance', 'wide'), ('tolerance', None), ('tolerance', float('nan')),
    ('line_width', 0), ('line_width', 1.5), ('image_transport', 'compressed')])
def test_rclpy_refuses_what_a_descriptor_excludes(context: Context, name: str, value: Any) -> None:
    """Its reasons differ from one distribution to the next, so that only their presence counts."""
    host = Host(context, {})
    before = host.get_parameter(name).value
    assert host.change(**{name: value})
    assert host.get_parameter(name).value == before
    assert len(host.applied) == 1


def test_the_paper_knows_no_region(context: Context) -> None:
    host = Host(context, {'method': 'paper', 'max_width': 320})
    for name in ('roi_x', 'roi_y', 'roi_width', 'roi_height'):
        assert "method is 'paper': must be 'arcs'" in host.change(**{name: 9})
    assert host.change(method='arcs', roi_x=9) == ''
    assert "method is 'paper'" in host.change(method='paper')
    assert host.change(method='paper', roi_x=0) == ''
