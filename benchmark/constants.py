"""
The constants of the core, as its sources state them, with their meaning and origin.

A constant is a name in capitals that a module binds to a number, to several numbers, or to an
expression of numbers such as ``math.sin(math.radians(10.0))``.  Numbers of columns do not count:
names that are bound together to whole numbers from 0 or 1 on, or that stand below a comment
"Columns of".  Neither do codes, below a comment "Bits of" or "Codes of".  The comment beside or
above a constant states its meaning and origin; a comment that begins with "All of these", "All of
the following" or "Origin of these" states the origin of all constants of a module that have none
of their own.
"""
from __future__ import annotations

import ast
from collections.abc import Iterator
import importlib
import inspect
import pkgutil
import re
from types import ModuleType
from typing import NamedTuple

from qflsd_ros import core

NOTE = re.compile(r'# (?:All of these|All of the following|Origin of these)\b')


class Constant(NamedTuple):
    """A constant of the core, as its module states it."""

    module: str     # with all packages
    name: str
    source: str     # its expression
    comment: str    # meaning and origin; constants of one statement share it
    line: int       # of the statement, from 1

    @property
    def title(self) -> str:
        """Return module and name, without the packages."""
        return f'{self.module.rpartition(".")[2]}.{self.name}'


def modules() -> list[ModuleType]:
    """Return all modules of the core, packages left out."""
    return [importlib.import_module(found.name) for found in
            pkgutil.walk_packages(core.__path__, f'{core.__name__}.') if not found.ispkg]


def constants() -> list[Constant]:
    """Return all constants of the core, module by module."""
    return [constant for module in modules()
            for constant in constants_of(inspect.getsource(module), module.__name__)]


def constants_of(source: str, module: str) -> Iterator[Constant]:
    """Yield the constants that the source of a module binds at its top level."""
    lines = source.splitlines()
    for statement in ast.parse(source).body:
        if not isinstance(statement, (ast.Assign, ast.AnnAssign)) or not _is_number(
                statement.value) or _is_column(lines, statement):
            continue
        comment = _comment(lines, statement)
        for name, value in bound(statement):
            if re.fullmatch('[A-Z][A-Z0-9_]*', name):
                yield Constant(module, name, ast.unparse(value), comment, statement.lineno)


def note(source: str) -> str:
    """Return what a module states of the origin of all its constants; may be empty."""
    lines = source.splitlines()
    return ' '.join(line.lstrip('# ') for i in range(len(lines)) for line in _note(lines[i:]))


def bound(statement: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    """Yield the names that an assignment binds, each with its expression."""
    if not isinstance(statement, (ast.Assign, ast.AnnAssign)):
        return
    value = statement.value
    target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
    if isinstance(target, ast.Name) and value is not None:
        yield target.id, value
    elif isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        for element, part in zip(target.elts, value.elts):
            if isinstance(element, ast.Name):
                yield element.id, part


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
    if isinstance(value, ast.Call):
        return ast.unparse(value.func).startswith('math.')
    return isinstance(value, ast.Attribute) and ast.unparse(value) == 'math.pi' or (
        isinstance(value, ast.Name) and value.id.isupper())


def _is_column(lines: list[str], statement: ast.stmt) -> bool:
    """Return whether the paragraph of a statement begins as a list of columns or codes."""
    first = statement.lineno - 1
    while first > 0 and lines[first - 1]:
        first -= 1
    return lines[first].startswith(('# Columns of ', '# Bits of ', '# Codes of '))


def _note(lines: list[str]) -> list[str]:
    """Return the sentence about all constants that the first of some lines begins, if it does."""
    if not lines or not NOTE.match(lines[0]):
        return []
    end = next(i for i, line in enumerate(lines) if line.endswith('.'))
    return lines[:end + 1]


def _comment(lines: list[str], node: ast.stmt) -> str:
    """Return the comment at the end of a statement, or the lines of comments just above it."""
    assert node.end_lineno is not None and node.end_col_offset is not None
    beside = lines[node.end_lineno - 1][node.end_col_offset:].strip()
    above: list[str] = []
    while lines[node.lineno - 2 - len(above)].startswith('#'):
        above.insert(0, lines[node.lineno - 2 - len(above)])
    above = above[len(_note(above)):]
    return ' '.join(line.strip('# ') for line in [*above, beside] if line)
