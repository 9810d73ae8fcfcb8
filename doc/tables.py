"""
Write the tables of parameters and reasons in README.md anew, from the code.

Run as ``python3 doc/tables.py`` after every change of one.
"""
from __future__ import annotations

from pathlib import Path
import re

from qflsd_ros.core import Parameters
from qflsd_ros.ros.camera import CameraSettings
from qflsd_ros.ros.parameters.declaration import markdown_table
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources import reasons

README = Path(__file__).parents[1] / 'README.md'
TABLES = {
    ('parameters of detector', 'end of detector'): markdown_table((Parameters, Settings)),
    ('parameters of camera', 'end of camera'): markdown_table((CameraSettings,)),
    ('reasons', 'end of reasons'): reasons.markdown_table()}


def renewed(text: str) -> str:
    """Return a text with a fresh table between the two marks of each."""
    for marks, table in TABLES.items():
        begin, end = (f'<!-- {mark} -->\n' for mark in marks)
        pattern = re.compile(f'(?<={begin}).*?(?={end})', re.DOTALL)
        text, count = pattern.subn(lambda _: table + '\n', text)
        assert count == 1, f'README.md lacks the marks\n{begin}{end}'
    return text


if __name__ == '__main__':
    README.write_text(renewed(README.read_text()))
