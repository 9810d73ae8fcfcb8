"""The table of faults names tests that exist."""
from __future__ import annotations

import ast
from pathlib import Path
import re

import pytest

ROOT = Path(__file__).parents[1]
ROWS = [row for row in (ROOT / 'doc' / 'faults.md').read_text().splitlines()
        if row.startswith('| ') and not row.startswith(('| fault |', '| risk |'))]


@pytest.mark.parametrize('row', ROWS, ids=range(len(ROWS)))
def test_every_row_names_a_test_that_exists(row: str) -> None:
    file, name = re.search(r'`(test/[\w/]+\.py)::(\w+)` \|$', row).groups()
    tree = ast.parse((ROOT / file).read_text())
    assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_there_are_rows() -> None:
    assert len(ROWS) > 30
