"""The detector's parameters from flags and from ROS parameter files."""
from __future__ import annotations

import dataclasses
from pathlib import Path
import re

import pytest
from qflsd_ros.cli import settings
from qflsd_ros.cli.detect import parser
from qflsd_ros.core import Parameters
import yaml

ROOT = Path(__file__).parents[2]


def read(*flags: str, params: object = None, folder: Path | None = None) -> Parameters:
    """Return the parameters of a command line; ``params`` is the content of its file."""
    if params is not None:
        assert folder is not None
        (folder / 'p.yaml').write_text(params if isinstance(params, str) else yaml.dump(params))
        flags += ('--params', str(folder / 'p.yaml'))
    return settings.read(parser().parse_args(['a.png', *flags]))


def test_without_flags_all_is_default() -> None:
    """Nothing given, nothing changed."""
    assert read() == Parameters()


@pytest.mark.parametrize('field', dataclasses.fields(Parameters), ids=lambda field: field.name)
def test_every_parameter_has_a_flag_and_a_line_of_help(field: dataclasses.Field) -> None:
    """A flag called like the field sets it, and the help speaks its sentence."""
    low, high, choices = (field.metadata[key] for key in ('low', 'high', 'choices'))
    value = choices[-1] if choices else high if field.name != 'contrast_low' else low
    assert getattr(read(f'--{field.name}={value}', '--contrast_high=255'), field.name) == value
    help_text = re.sub(r'\s+', ' ', parser().format_help())
    assert re.sub(r'\s+', ' ', field.metadata['description']) in help_text


def test_values_out_of_range_are_refused() -> None:
    """The error names parameter, value and range."""
    with pytest.raises(settings.SettingsError, match='tolerance is 99.* 0.1 to 10'):
        read('--tolerance', '99')


def test_the_shipped_file_can_be_read() -> None:
    """The parameter file of the node serves the command, too."""
    assert read('--params', str(ROOT / 'config' / 'detector.yaml')) == Parameters()


def test_flags_win_over_the_file(tmp_path: Path) -> None:
    """What a flag says counts more than what the file says; an integer serves as a float."""
    params = {'/**': {'ros__parameters': {'tolerance': 2, 'min_length': 30.0}}}
    found = read('--min_length', '40', params=params, folder=tmp_path)
    assert found == Parameters(tolerance=2.0, min_length=40.0)


def test_a_section_of_the_node_wins_over_the_wildcard(tmp_path: Path) -> None:
    """As in ROS, other nodes' sections do not count."""
    params = {'detector': {'ros__parameters': {'tolerance': 3.0, 'use_sim_time': True}},
              '/**': {'ros__parameters': {'tolerance': 2.0}},
              'camera': {'ros__parameters': {'rate': 5.0}}}
    assert read(params=params, folder=tmp_path).tolerance == 3.0


def test_a_misspelt_key_is_refused_with_the_nearest_one(tmp_path: Path) -> None:
    """A typo does not pass silently."""
    params = {'/**': {'ros__parameters': {'min_lenght': 30.0}}}
    with pytest.raises(settings.SettingsError, match="p.yaml.*'min_lenght'.*min_length"):
        read(params=params, folder=tmp_path)


@pytest.mark.parametrize('text', ['', 'a: [', '- 1', '/**: 1', '/**:\n  tolerance: 1',
                                  'camera:\n  ros__parameters: {rate: 1}', '\x00'])
def test_other_files_are_refused(tmp_path: Path, text: str) -> None:
    """What is no ROS parameter file ends in an error that names the file."""
    with pytest.raises(settings.SettingsError, match='p.yaml'):
        read(params=text, folder=tmp_path)


def test_a_file_that_is_not_there_is_named() -> None:
    """A missing file is an error that names it."""
    with pytest.raises(settings.SettingsError, match='nowhere.yaml'):
        read('--params', 'nowhere.yaml')
