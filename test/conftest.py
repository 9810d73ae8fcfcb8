"""The order of tests, and the worker of pytest-xdist in which those of a module run."""
from __future__ import annotations

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Group tests by module where each worker would set up a costly fixture of its own."""
    for item in items:
        definitions = item._fixtureinfo.name2fixturedefs  # there is no public way
        if any(definition[-1].scope == 'module' for definition in definitions.values()):
            item.add_marker(pytest.mark.xdist_group(item.nodeid.partition('::')[0]))
    # The linters first: they are single long tests, beside which the others run.
    items.sort(key=lambda item: item.get_closest_marker('linter') is None)
