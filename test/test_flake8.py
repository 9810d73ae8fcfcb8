"""Style of the code."""
from __future__ import annotations

from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[1]
CODE = [str(ROOT / name) for name in (
    'qflsd_ros', 'test', 'benchmark', 'doc', 'examples', 'launch', 'setup.py')]


@pytest.mark.flake8
@pytest.mark.linter
def test_flake8() -> None:
    """All code is clean under ament_flake8."""
    # In a process of its own: flake8 forks, which does not go well with the threads of ROS.
    result = subprocess.run([sys.executable, '-m', 'ament_flake8.main', *CODE], text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300)
    assert result.returncode == 0, result.stdout
