"""Style of the code."""
from __future__ import annotations

from pathlib import Path

from ament_flake8.main import main_with_errors
import pytest

ROOT = Path(__file__).parents[1]
CODE = [str(ROOT / name) for name in (
    'qflsd_ros', 'test', 'benchmark', 'doc', 'examples', 'setup.py')]


@pytest.mark.flake8
@pytest.mark.linter
def test_flake8() -> None:
    """All code is clean under ament_flake8."""
    code, errors = main_with_errors(CODE)
    assert code == 0, '\n'.join(errors)
