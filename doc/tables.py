"""
Write the generated tables of the documents in this folder anew, from the code.

Run as ``python3 doc/tables.py`` after every change of a parameter, a reason or a constant.
"""
from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
import re

from qflsd_ros.core import Parameters
from qflsd_ros.ros.camera import CameraSettings
from qflsd_ros.ros.parameters.declaration import markdown_table
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources import reasons

FOLDER = Path(__file__).parent
CORE = FOLDER.parent / 'qflsd_ros' / 'core'
# Modules whose constants decide what is detected, in the order of the stages.
MODULES = ('detector', 'detection/frame', 'detection/region', 'detection/noise',
           'detection/thresholds', 'detection/gradients', 'detection/chains', 'circle',
           'detection/extraction', 'detection/grid', 'detection/agreement', 'detection/joining',
           'detection/validation', 'detection/extension', 'detection/suppression',
           'detection/refinement', 'lens/estimation', 'lens/tracker')


def constants_table() -> str:
    """Return a table of the numbers that are set in the core, with the comments beside them."""
    rows = [f'| `{module}` | `{name}` | `{value}` | {comment} |' for module in MODULES
            for name, value, comment in constants((CORE / f'{module}.py').read_text())]
    return '\n'.join(['| module | constant | value | meaning and origin |', '|---|---|---|---|',
                      *rows])


def constants(source: str) -> Iterator[tuple[str, str, str]]:
    """Yield the name, value and comment of each number that a module sets at its top level."""
    lines = source.splitlines()
    for node in ast.parse(source).body:
        if not isinstance(node, (ast.Assign, ast.AnnAssign)) or not _is_number(node.value):
            continue
        target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
        name, value = _listed(target), _listed(node.value)
        if re.fullmatch(r'[A-Z0-9_, ]+', name):
            yield name, value, _comment(lines, node).replace('|', '\\|')


def _listed(node: ast.expr | None) -> str:
    """Return the source of an expression, of a tuple without its parentheses."""
    parts = node.elts if isinstance(node, ast.Tuple) else [node] if node else []
    return ', '.join(map(ast.unparse, parts))


def _is_number(value: ast.expr | None) -> bool:
    """Return whether a value is a number, or several that are no numbers of columns."""
    if isinstance(value, (ast.Tuple, ast.Dict)):
        parts = value.elts if isinstance(value, ast.Tuple) else value.values
        whole = [part.value for part in parts
                 if isinstance(part, ast.Constant) and isinstance(part.value, int)]
        columns = whole[:1] in ([0], [1]) and whole == sorted(whole)
        return all(map(_is_number, parts)) and not columns
    if isinstance(value, ast.Constant):
        return isinstance(value.value, (int, float))
    if isinstance(value, ast.UnaryOp):
        return _is_number(value.operand)
    if isinstance(value, ast.BinOp):
        return _is_number(value.left) and _is_number(value.right)
    return isinstance(value, ast.Name) or (
        isinstance(value, ast.Call) and ast.unparse(value.func).startswith('math.'))


def _comment(lines: list[str], node: ast.stmt) -> str:
    """Return the comment at the end of a statement, or the lines of comments just above it."""
    assert node.end_lineno is not None and node.end_col_offset is not None
    beside = lines[node.end_lineno - 1][node.end_col_offset:].strip()
    above: list[str] = []
    while lines[node.lineno - 2 - len(above)].startswith('#'):
        above.insert(0, lines[node.lineno - 2 - len(above)])
    return ' '.join(line.strip('# ') for line in [*above, beside] if line)


# By document, the table between the marks <!-- NAME --> and <!-- end of NAME -->.
TABLES = {
    'parameters.md': {'detector': markdown_table((Parameters, Settings))},
    'camera.md': {'camera': markdown_table((CameraSettings,))},
    'troubleshooting.md': {'reasons': reasons.markdown_table()},
    'design.md': {'constants': constants_table()}}


def renewed(document: str) -> str:
    """Return the text of a document with a fresh table between each pair of marks."""
    text = (FOLDER / document).read_text()
    for name, table in TABLES[document].items():
        begin, end = f'<!-- {name} -->\n', f'<!-- end of {name} -->\n'
        pattern = re.compile(f'(?<={begin}).*?(?={end})', re.DOTALL)
        text, count = pattern.subn(lambda _: table + '\n', text)
        assert count == 1, f'{document} lacks the marks\n{begin}{end}'
    return text


if __name__ == '__main__':
    for document in TABLES:
        (FOLDER / document).write_text(renewed(document))
