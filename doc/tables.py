"""
Write the parameter tables of README.md anew, from the dataclasses.

Run as ``python3 doc/tables.py`` after every change of a parameter.
"""
from __future__ import annotations

from pathlib import Path
import re

from qflsd_ros.core import Parameters
from qflsd_ros.ros.camera import CameraParameters
from qflsd_ros.ros.node_parameters import NodeParameters
from qflsd_ros.ros.parameters import markdown_table

README = Path(__file__).parents[1] / 'README.md'
TABLES = {'detector': (Parameters, NodeParameters), 'camera': (CameraParameters,)}


def renewed(text: str) -> str:
    """Return a text with a fresh table between the two marks of each node."""
    for node, kinds in TABLES.items():
        begin, end = f'<!-- parameters of {node} -->\n', f'<!-- end of {node} -->\n'
        pattern = re.compile(f'(?<={begin}).*?(?={end})', re.DOTALL)
        text, count = pattern.subn(lambda _: markdown_table(kinds) + '\n', text)
        assert count == 1, f'README.md lacks the marks\n{begin}{end}'
    return text


if __name__ == '__main__':
    README.write_text(renewed(README.read_text()))
