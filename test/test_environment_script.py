"""The distributions of ROS that script/environment.sh accepts, and what it installs for each."""
from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[1]
SOURCED = ('jazzy', 'kilted', 'lyrical', 'rolling')


def source(command: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a command of bash behind ``. script/environment.sh`` in a shell without ROS."""
    environment = {name: value for name, value in os.environ.items()
                   if name not in ('ROS_DISTRO', 'ROS_WHEELS')}
    return subprocess.run(
        ['bash', '-euc', f'. script/environment.sh; PYTHON={sys.executable}; {command}'],
        cwd=ROOT, env=environment | variables, capture_output=True, text=True)


def said(command: str, **variables: str) -> str:
    """Return what a command prints that must succeed."""
    result = source(command, **variables)
    assert result.returncode == 0, result.stderr
    return result.stdout.strip()


@pytest.mark.parametrize('distro', SOURCED)
def test_a_sourced_ros_needs_no_wheels(distro: str) -> None:
    assert said('check_ros; all_extras test', ROS_DISTRO=distro) == 'test'
    assert said('all_extras', ROS_DISTRO=distro, ROS_WHEELS='kilted') == ''


@pytest.mark.parametrize('distro', ['humble', 'iron', 'jazz', 'jazzy2'])
def test_another_sourced_ros_is_refused(distro: str) -> None:
    result = source('check_ros', ROS_DISTRO=distro)
    assert result.returncode == 1
    assert f'has ROS 2 {distro} sourced' in result.stderr
    assert all(name.capitalize() in result.stderr for name in SOURCED)


def test_wheels_are_those_of_jazzy_unless_others_are_chosen() -> None:
    assert said('check_ros; all_extras test') == 'test,ros,ros-test'
    assert said('check_ros; all_extras') == 'ros'
    assert said('check_ros; all_extras test', ROS_WHEELS='kilted') == 'test,kilted'
    assert said('check_ros; all_extras', ROS_WHEELS='kilted') == 'kilted'


def test_wheels_that_do_not_exist_are_refused() -> None:
    result = source('check_ros', ROS_WHEELS='lyrical')
    assert result.returncode == 1 and "ROS_WHEELS is 'lyrical'" in result.stderr


def test_every_distribution_has_an_environment_of_its_own() -> None:
    """Another one, sourced or as wheels, makes .venv anew."""
    choices = [{}, {'ROS_WHEELS': 'kilted'}, *({'ROS_DISTRO': distro} for distro in SOURCED)]
    assert len({said('foundation', **choice) for choice in choices}) == len(choices)


def test_the_numpy_of_a_sourced_ros_is_kept(tmp_path: Path) -> None:
    """Whichever version that is; wheels go with any."""
    (tmp_path / 'bin').mkdir()
    (tmp_path / 'bin' / 'python').symlink_to(sys.executable)
    stub = f'VENV={tmp_path}; constraints'
    pinned = said(stub, ROS_DISTRO='kilted', PYTHONPATH=os.pathsep.join(sys.path))
    assert pinned.startswith('numpy==')
    assert said(stub) == ''
