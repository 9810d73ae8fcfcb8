"""
Write the generated tables of the documents in this folder anew, from the code.

Run as ``python3 -m doc.tables`` after every change of a parameter, a reason or a constant.
"""
from __future__ import annotations

from inspect import getsource
from itertools import groupby
from pathlib import Path
import re
from types import ModuleType

from benchmark.constants import Constant, constants_of, modules, note
from qflsd_ros import core
from qflsd_ros.core import Parameters
from qflsd_ros.ros.camera import CameraSettings
from qflsd_ros.ros.parameters.declaration import markdown_table
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources import reasons

FOLDER = Path(__file__).parent


def constants_tables() -> str:
    """Return a section for each module of the core that has constants, with a table of them."""
    return '\n\n'.join(_section(module, found) for module in modules()
                       if (found := list(constants_of(getsource(module), module.__name__))))


def _section(module: ModuleType, constants: list[Constant]) -> str:
    """Return the section of a module: its note on the origin of all, and a row per statement."""
    path = module.__name__.removeprefix(f'{core.__name__}.').replace('.', '/')
    origin = note(getsource(module))
    rows = [_row(list(together)) for _, together in groupby(constants, lambda each: each.line)]
    return '\n'.join([f'### `{path}`', '', *([origin, ''] if origin else []),
                      '| constant | value | meaning and origin |', '|---|---|---|', *rows])


def _row(together: list[Constant]) -> str:
    """Return the row of the constants of one statement."""
    names, values = (', '.join(parts) for parts in zip(*(
        (constant.name, constant.source) for constant in together)))
    comment = together[0].comment.replace('|', '\\|')
    return f'| `{names}` | `{values}` | {comment} |'


# By document, the table between the marks <!-- NAME --> and <!-- end of NAME -->.
TABLES = {
    'parameters.md': {'detector': markdown_table((Parameters, Settings))},
    'camera.md': {'camera': markdown_table((CameraSettings,))},
    'troubleshooting.md': {'reasons': reasons.markdown_table()},
    'constants.md': {'constants': constants_tables()}}


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
