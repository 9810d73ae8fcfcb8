"""The container file names what package.xml asks for, and what setup.py installs."""
from __future__ import annotations

from pathlib import Path
import re
import runpy
from typing import Any

from catkin_pkg.package import Package, parse_package
import pytest
import setuptools

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / 'docker' / 'Dockerfile').read_text()
COMMANDS = re.sub(r'^#.*\n', '', TEXT, flags=re.MULTILINE)
# Keys of rosdep, and PyPI packages, of what Ubuntu 24.04 has no package of.
FROM_PYPI = {'python3-rosbags-pip': 'rosbags', 'python3-numba': 'numba'}


def dependencies() -> set[str]:
    package: Package = parse_package(str(ROOT / 'package.xml'))
    return {depend.name for depend in package.exec_depends}


def words(command: str) -> set[str]:
    """Return the words of a command, up to the next one."""
    [text] = re.findall(rf'{command}(.*?)(?:&&|\n[A-Z]|\n\n)', COMMANDS, re.DOTALL)
    return set(text.replace('\\\n', ' ').split())


def test_every_dependency_is_installed() -> None:
    debian = {key if key.startswith('python3-') else f'ros-jazzy-{key.replace("_", "-")}'
              for key in dependencies() - set(FROM_PYPI)}
    assert words('apt-get install') - {'-y', '--no-install-recommends', 'python3-pip'} == debian
    pip = {re.sub("[<'].*", '', word.strip("'")) for word in words('pip install')
           if not word.startswith('-')}
    assert pip == {'numpy', *FROM_PYPI.values()}
    assert dependencies() >= set(FROM_PYPI)


def test_it_names_every_executable(monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[str, Any] = {}
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(setuptools, 'setup', given.update)
    runpy.run_path('setup.py')
    executables = {entry.split()[0] for entry in given['entry_points']['console_scripts']}
    others = re.search(r'# Others: (.*)\.', TEXT)
    [default] = re.findall(r'CMD \[.*"(\w+)"\]', TEXT)
    assert others and {default, *others[1].split(', ')} == executables


def test_kernels_are_compiled_into_it() -> None:
    """After the build, and into the folder that the nodes use."""
    build, compiled = (TEXT.index(text) for text in ('colcon build', 'qflsd_ros warm_up \\'))
    folder = re.search(r'NUMBA_CACHE_DIR=(\S+)', TEXT)
    assert folder and build < folder.start() < compiled
    assert f'a+rX {folder[1]}' in TEXT
