"""Style of the docstrings."""
from __future__ import annotations

from pathlib import Path

from ament_pep257.main import main
import pytest

ROOT = Path(__file__).parents[1]
CODE = [str(ROOT / name) for name in (
    'qflsd_ros', 'test', 'benchmark', 'doc', 'examples', 'launch', 'setup.py')]


@pytest.mark.linter
@pytest.mark.pep257
def test_pep257(capfd: pytest.CaptureFixture[str]) -> None:
    """All docstrings are clean under ament_pep257."""
    code = main(CODE)
    assert code == 0, capfd.readouterr().err
