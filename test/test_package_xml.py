"""What package.xml asks of rosdep, and setup.py of pip, is what the package imports."""
from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
import re
import runpy
import sys
from typing import Any

from catkin_pkg.package import Package, parse_package
import pytest
import setuptools

ROOT = Path(__file__).parents[1]
# Key of rosdep, package on PyPI, module: for all that is not of ROS.
PYTHON = (
    ('python3-hypothesis', 'hypothesis', 'hypothesis'),
    ('python3-matplotlib', 'matplotlib', 'matplotlib'),
    ('python3-numba', 'numba', 'numba'),
    ('python3-numpy', 'numpy', 'numpy'),
    ('python3-opencv', 'opencv-python-headless', 'cv2'),
    ('python3-pytest', 'pytest', 'pytest'),
    ('python3-rosbags-pip', 'rosbags', 'rosbags'),
    ('python3-scipy', 'scipy', 'scipy'),
    ('python3-tqdm', 'tqdm', 'tqdm'),
    ('python3-yaml', 'PyYAML', 'yaml'),
)
DISTROS = ('jazzy', 'kilted', 'lyrical', 'rolling')
NUMBA_FROM_PYPI = ('jazzy', 'kilted')  # on Ubuntu 24.04


def keys(distro: str, kind: str = 'exec_depends') -> set[str]:
    """Return the keys of package.xml that hold under a distribution of ROS."""
    package: Package = parse_package(str(ROOT / 'package.xml'))
    package.evaluate_conditions({'ROS_DISTRO': distro})
    return {depend.name for depend in getattr(package, kind) if depend.evaluated_condition}


@pytest.fixture(scope='module')
def setup() -> dict[str, Any]:
    """Return the arguments that setup.py gives to setuptools."""
    given: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        patch.setattr(setuptools, 'setup', given.update)
        runpy.run_path('setup.py')
    return given


def names(requirements: list[str]) -> set[str]:
    """Return the names of packages on PyPI, without their versions."""
    return {re.split('[^a-zA-Z0-9_.-]', requirement)[0] for requirement in requirements}


def imported(*folders: str) -> Iterator[str]:
    """Yield the modules of others that the code in some folders imports."""
    for file in (file for folder in folders for file in (ROOT / folder).rglob('*.py')):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                yield from (alias.name.split('.')[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                yield node.module.split('.')[0]


@pytest.mark.parametrize('distro', DISTROS)
def test_keys_are_those_of_what_is_imported(distro: str) -> None:
    """Each import of package, launch file and examples has its key, and each key its import."""
    found = set(imported('qflsd_ros', 'launch', 'examples'))
    others = found - sys.stdlib_module_names - {'qflsd_ros'}
    known = {module: key for key, _, module in PYTHON}
    wanted = {known.get(module, module) for module in others}
    if distro in NUMBA_FROM_PYPI:
        wanted.remove('python3-numba')
    assert keys(distro) == wanted


def test_pip_installs_what_rosdep_does(setup: dict[str, Any]) -> None:
    on_pypi = {key: name for key, name, _ in PYTHON}
    run, test = (keys('rolling', kind) for kind in ('exec_depends', 'test_depends'))
    assert names(setup['install_requires']) == {on_pypi[key] for key in run & set(on_pypi)}
    assert names(setup['extras_require']['test']) >= {on_pypi[key] for key in test & set(on_pypi)}


def test_wheels_of_both_distributions_are_the_same(setup: dict[str, Any]) -> None:
    jazzy = setup['extras_require']['ros'] + setup['extras_require']['ros-test']
    assert sorted(name.replace('jazzy', 'kilted') for name in jazzy) == sorted(
        setup['extras_require']['kilted'])


def test_setup_and_package_are_described_alike(setup: dict[str, Any]) -> None:
    package = parse_package(str(ROOT / 'package.xml'))
    assert (setup['name'], setup['version']) == (package.name, package.version)
    assert [setup['license']] == package.licenses
    assert setup['maintainer_email'] in [one.email for one in package.maintainers]


def test_launch_files_are_installed_where_ros2_launch_looks(setup: dict[str, Any]) -> None:
    installed = dict(setup['data_files'])['share/qflsd_ros/launch']
    assert {ROOT / name for name in installed} == set((ROOT / 'launch').glob('*.py'))
