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


SAID: list[str] = []


def read_all(*flags: str, params: object = None, folder: Path | None = None) -> settings.Options:
    """Return the settings of a command line; ``params`` is the content of its file."""
    if params is not None:
        assert folder is not None
        text = params if isinstance(params, str) else yaml.dump(params, sort_keys=False)
        (folder / 'p.yaml').write_text(text)
        flags += ('--params', str(folder / 'p.yaml'))
    SAID.clear()
    return settings.read(parser().parse_args(['a.png', *flags]), SAID.append)


def read(*flags: str, params: object = None, folder: Path | None = None) -> Parameters:
    """Return the same of the detector alone."""
    return read_all(*flags, params=params, folder=folder).detector


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
    assert SAID == []


def test_flags_win_over_the_file(tmp_path: Path) -> None:
    """What a flag says counts more than what the file says; an integer serves as a float."""
    params = {'/**': {'ros__parameters': {'tolerance': 2, 'min_length': 30.0}}}
    found = read('--min_length', '40', params=params, folder=tmp_path)
    assert found == Parameters(tolerance=2.0, min_length=40.0)


def test_of_sections_that_match_the_later_one_wins(tmp_path: Path) -> None:
    """As in ROS, other nodes' sections do not count."""
    params = {'detector': {'ros__parameters': {'tolerance': 3.0}},
              '/**': {'ros__parameters': {'tolerance': 2.0}},
              'camera': {'ros__parameters': {'rate': 5.0}}}
    assert read(params=params, folder=tmp_path).tolerance == 2.0
    params['detector'] = params.pop('detector')
    assert read(params=params, folder=tmp_path).tolerance == 3.0
    assert SAID == []


def test_sections_of_another_node_count_where_it_is_named(tmp_path: Path) -> None:
    params = {'left': {'detector': {'ros__parameters': {'tolerance': 3.0}}},
              '/*/detector': {'ros__parameters': {'min_length': 40.0}}}
    assert read('--node', '/left/detector', params=params, folder=tmp_path) == Parameters(
        tolerance=3.0, min_length=40.0)
    assert SAID == []
    assert read(params=params, folder=tmp_path) == Parameters()
    line, = SAID
    assert 'p.yaml: no section matches the node /detector' in line and '--node' in line
    assert '/left/detector, /*/detector' in line
    with pytest.raises(settings.SettingsError, match="--node is 'left'"):
        read('--node', 'left', params=params, folder=tmp_path)


def test_a_misspelt_key_is_named_with_the_nearest_one(tmp_path: Path) -> None:
    """As the node does, it goes on: a file may be for other nodes as well."""
    params = {'/**': {'ros__parameters': {'min_lenght': 30.0, 'fps': 3}}}
    assert read(params=params, folder=tmp_path) == Parameters()
    assert len(SAID) == 2
    assert SAID[0].endswith('p.yaml, line 3: there is no parameter min_lenght, it is ignored: '
                            'did you mean min_length?')


def test_what_counts_here_and_what_is_named(tmp_path: Path) -> None:
    """Whatever the file says has an effect, or is named; a default has none anywhere."""
    counts = {'white_level': 1023.0, 'roi_x': 3, 'roi_y': 4, 'roi_width': 50, 'roi_height': 60,
              'max_width': 70, 'tracking': False, 'trails': 5,
              'polyline_tolerance': 0.5, 'line_width': 2, 'lens': 'off',
              'lens_lambda': -0.2, 'lens_centre_x': 5.0, 'lens_centre_y': 6.0,
              'lens_find_centre': True, 'focal_length': 450.0, 'attitude': True, 'up_hint': '+y',
              'focal': 'fixed', 'draw_attitude': False}
    idle = {'max_age': 0.0, 'hardware_id': 'left', 'use_sim_time': True,
            'qos_overrides': {'/image': {'subscription': {'reliability': 'reliable'}}}}
    params = {'/**': {'ros__parameters': counts | idle | {'marker_colour': 'track'}}}
    found = read_all(params=params, folder=tmp_path)
    assert {name: getattr(found.node, name) for name in counts} == counts
    line, = SAID
    assert line.endswith('p.yaml: parameters without effect here: max_age, hardware_id, '
                         'use_sim_time, qos_overrides./image.subscription.reliability')
    known = set(dataclasses.asdict(found.node)) - {'mask'}
    assert known == set(counts) | set(settings.IDLE)


def test_a_value_that_cannot_be_used_is_named_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(settings.SettingsError, match=r'tolerance is 99.*p.yaml, line 3\)'):
        read(params='/**:\n  ros__parameters:\n    tolerance: 99\n', folder=tmp_path)
    with pytest.raises(settings.SettingsError, match="method is 'paper': must be 'arcs' with"):
        read('--method', 'paper', '--roi_x', '3')


@pytest.mark.parametrize('text', ['a: [', '- 1', '/**: 1', '/**:\n  tolerance: 1', '\x00'])
def test_other_files_are_refused(tmp_path: Path, text: str) -> None:
    """What is no ROS parameter file ends in an error that names the file."""
    with pytest.raises(settings.SettingsError, match='p.yaml'):
        read(params=text, folder=tmp_path)


def test_a_file_that_is_not_there_is_named() -> None:
    """A missing file is an error that names it."""
    with pytest.raises(settings.SettingsError, match='nowhere.yaml'):
        read('--params', 'nowhere.yaml')
