"""Style of the code."""
from __future__ import annotations

import hashlib
from importlib.metadata import entry_points
from pathlib import Path
import subprocess
import sys

import ament_flake8
import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = 'qflsd_ros', 'test', 'benchmark', 'doc', 'examples', 'launch'
CLEAN = 'qflsd_ros/flake8_clean'    # in pytest's cache


def rules() -> bytes:
    """Return a digest of all that the result depends on beside the file: plugins and settings."""
    checkers = {f'{point.dist.name} {point.dist.version}'
                for point in entry_points(group='flake8.extension') if point.dist}
    settings = Path(ament_flake8.__file__).with_name('configuration') / 'ament_flake8.ini'
    return hashlib.sha256(repr((sys.version, sorted(checkers))).encode()
                          + settings.read_bytes()).digest()


@pytest.mark.flake8
@pytest.mark.linter
def test_flake8(cache: pytest.Cache) -> None:
    """All code is clean under ament_flake8; files that were clean before are not read again."""
    files = [file for folder in FOLDERS for file in sorted((ROOT / folder).rglob('*.py'))]
    files.append(ROOT / 'setup.py')
    assert len(files) > len(FOLDERS)
    common, known = rules(), set(cache.get(CLEAN, []))
    digests = {file: hashlib.sha256(common + str(file).encode() + file.read_bytes()).hexdigest()
               for file in files}
    changed = [str(file) for file in files if digests[file] not in known]
    if changed:
        # In a process of its own: flake8 forks, which does not go well with the threads of ROS.
        result = subprocess.run([sys.executable, '-m', 'ament_flake8.main', *changed], text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300)
        assert result.returncode == 0, result.stdout
    cache.set(CLEAN, list(digests.values()))
