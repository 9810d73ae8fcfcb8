"""Annotations of the package, the benchmark and the documents' scripts, under mypy."""
from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[1]
NEEDED = ('mypy', 'scipy-stubs', 'types-PyYAML', 'types-tqdm')


@pytest.mark.linter
def test_mypy() -> None:
    """All code is clean under the settings of pyproject.toml."""
    for name in NEEDED:
        try:
            version(name)
        except PackageNotFoundError:
            pytest.skip(f'{name} is not installed; it comes with the extra "test" of setup.py')
    result = subprocess.run([sys.executable, '-m', 'mypy'], cwd=ROOT, text=True, timeout=300,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert result.returncode == 0, result.stdout
