"""The paper's settings, config/paper.yaml: the node and the command take them, whole."""
from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from qflsd_ros.cli.demo import free_domain
from qflsd_ros.cli.detect import main
from qflsd_ros.core import Detector, Parameters
from qflsd_ros.ros.parameters import declaration
from rclpy.context import Context
from rclpy.node import Node
import yaml

FILE = Path(__file__).parents[1] / 'config' / 'paper.yaml'
GIVEN = yaml.safe_load(FILE.read_text())['/**']['ros__parameters']
OTHERS = [field for field in dataclasses.fields(Parameters) if field.name not in GIVEN]


@pytest.fixture
def gray() -> np.ndarray:
    """Return a bright rectangle on a dark ground: (90, 120) uint8."""
    gray = np.full((90, 120), 30, np.uint8)
    gray[20:70, 30:90] = 200
    return gray


def test_the_command_runs_with_it(gray: np.ndarray, tmp_path: Path) -> None:
    """Its values are those of the result, and the rectangle's sides are found."""
    cv2.imwrite(str(tmp_path / 'a.png'), gray)
    assert main([str(tmp_path / 'a.png'), '--params', str(FILE),
                 '--output', str(tmp_path / 'found')]) == 0
    found = json.loads((tmp_path / 'found' / 'a.json').read_text())
    expected = dataclasses.asdict(Parameters(**GIVEN))
    assert found['parameters'] | expected == found['parameters']
    assert found['parameters']['method'] == 'paper'
    assert len(found['arcs']) >= 4


def test_a_node_takes_it() -> None:
    """The node has every value of the file from its start."""
    context, applied = Context(), []
    context.init(['--ros-args', '--params-file', str(FILE)], domain_id=free_domain())
    try:
        node = Node('detector', context=context)
        declaration.attach(node, (Parameters,), applied.append)
        assert set(GIVEN) <= set(node.list_parameters([], 0).names)
        assert applied == [Parameters(**GIVEN)]
        node.destroy_node()
    finally:
        context.try_shutdown()


@pytest.mark.parametrize('field', OTHERS, ids=lambda field: field.name)
def test_it_leaves_out_just_what_has_no_effect(field: dataclasses.Field,
                                               gray: np.ndarray) -> None:
    """Whatever value a parameter has that is not in the file, the result is the same."""
    wanted = Detector(Parameters(**GIVEN)).detect(gray)
    for value in field.metadata['choices'] or (field.metadata['low'], field.metadata['high']):
        found = Detector(Parameters(**GIVEN, **{field.name: value})).detect(gray)
        assert np.array_equal(found.table, wanted.table)
