"""The order of tests, and the worker of pytest-xdist in which those of a module run."""
from __future__ import annotations

from pathlib import Path
import re
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
SHARED = re.compile(r"scope='module'|\bmodule_peer\b")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the linters: they are single long tests, beside which the others run."""
    items.sort(key=lambda item: item.get_closest_marker('linter') is None)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """
    Send all tests of a module with a costly fixture to one worker, which sets it up once.

    The marks ``xdist_group`` of pytest-xdist 3.8 have no effect with pytest 9.2, see
    https://github.com/pytest-dev/pytest-xdist/issues/1386.
    """
    if config.getoption('dist') != 'loadscope':
        return None
    from xdist.scheduler import LoadScopeScheduling

    class Scheduling(LoadScopeScheduling):

        def _split_scope(self, nodeid: str) -> str:
            module = nodeid.partition('::')[0]
            return module if SHARED.search((ROOT / module).read_text()) else nodeid
    return Scheduling(config, log)
