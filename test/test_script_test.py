"""``script/test`` without arguments: both of its runs count, in one closing line and exit code."""
from __future__ import annotations

import os
from pathlib import Path
import re
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[1]
TESTS = """
import os, pytest

def test_one(): assert 'PYTEST_XDIST_WORKER' in os.environ
def test_two(): assert {together}
@pytest.mark.skip
def test_three(): pass
@pytest.mark.alone
def test_four(): assert 'PYTEST_XDIST_WORKER' not in os.environ and {alone}
"""


@pytest.mark.skipif(Path(sys.prefix) != ROOT / '.venv', reason='script/test has not made .venv')
@pytest.mark.parametrize('together, alone', [(True, True), (False, True), (True, False)])
def test_both_runs_count(tmp_path: Path, together: bool, alone: bool) -> None:
    file = tmp_path / 'test_few.py'
    file.write_text(TESTS.format(together=together, alone=alone))
    environment = {name: value for name, value in os.environ.items()
                   if not name.startswith('PYTEST')}
    result = subprocess.run(['script/test'], cwd=ROOT, text=True, capture_output=True, timeout=300,
                            env=environment | {'PYTEST_ADDOPTS': f'-p no:cacheprovider {file}'})
    failed = (together, alone).count(False)
    assert result.returncode == (failed > 0), result.stderr
    assert re.fullmatch(f'All together: {3 - failed} passed, {failed} failed, 0 errors, '
                        r'1 skipped in \d+ s', result.stdout.splitlines()[-1])
