"""The parameter files for kinds of cameras contain known parameters with valid values."""
from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from qflsd_ros.core import Detector, Parameters
from qflsd_ros.ros.parameters.node_parameters import Settings
from rig import image, Rig, same, SCENE
import yaml

if TYPE_CHECKING:
    from conftest import Peer

CONFIG = Path(__file__).parents[2] / 'config'
KINDS = (Parameters, Settings)
PRESETS = ('fisheye', 'indoor', 'high_speed')


def values(name: str) -> dict[str, object]:
    return yaml.safe_load((CONFIG / f'{name}.yaml').read_text())['/**']['ros__parameters']


@pytest.mark.parametrize('name', PRESETS)
def test_values_can_be_used_and_differ_from_the_defaults(name: str) -> None:
    given = values(name)
    known = {field.name: field for kind in KINDS for field in fields(kind)}
    assert 0 < len(given) <= 6 and set(given) <= set(known)
    for kind in KINDS:
        kind(**{field.name: given[field.name] for field in fields(kind) if field.name in given})
    for parameter, value in given.items():
        assert value != known[parameter].default
        assert type(value) is type(known[parameter].default)


@pytest.mark.parametrize('name', PRESETS)
def test_every_value_has_its_reason_above(name: str) -> None:
    lines = [line.strip() for line in (CONFIG / f'{name}.yaml').read_text().splitlines()]
    body = lines[lines.index('ros__parameters:') + 1:]
    assert body[0].startswith('# ')
    assert f'{name}.yaml' in ''.join(lines[:3])


@pytest.mark.slow
def test_the_node_loads_one_without_a_word(peer: Peer) -> None:
    name = 'fisheye'
    rig = Rig(peer, '--params-file', f'config/{name}.yaml').ready()
    parameters = Parameters(**{key: value for key, value in values(name).items()
                               if key in {field.name for field in fields(Parameters)}})
    expected = Detector(parameters).detect(SCENE).polylines(0.1)
    assert same(rig.detect(image(SCENE)), expected)
    assert 'WARN' not in rig.process.output
