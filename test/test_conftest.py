"""Tests of a module with a costly fixture share it in one worker of pytest-xdist, too."""
from __future__ import annotations

import os
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow   # script/test --quick distributes its tests in another way


@pytest.fixture(scope='module')
def used(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a file for the names of the workers that have set up this fixture."""
    return tmp_path_factory.getbasetemp().parent / os.environ.get('PYTEST_XDIST_TESTRUNUID', '')


@pytest.mark.parametrize('number', range(8))
def test_one_worker_runs_the_module(used: Path, number: int) -> None:
    worker = os.environ.get('PYTEST_XDIST_WORKER')
    if worker is None:
        pytest.skip('there are no workers')
    with used.open('a+') as file:
        file.write(f'{worker}\n')
    assert set(used.read_text().split()) == {worker}
