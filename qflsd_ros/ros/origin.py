"""Where a parameter was set: rcl reads parameter files and does not tell; imports no ROS."""
from __future__ import annotations

from pathlib import Path
import re
from typing import Iterator, Sequence

from qflsd_ros.ros.parameter_file import Loader
import yaml

SECTION = 'ros__parameters.'


def origin(text: str, arguments: Sequence[str]) -> str:
    """
    Say which lines of parameter files set the parameters that a text names.

    ``arguments`` is the command line.  Returns ' (FILE, line N)', or nothing where no file does.
    """
    places = [f'{file}, line {line}'
              for flag, file in zip(arguments, arguments[1:]) if flag == '--params-file'
              for name, line in _lines(file)
              if re.search(rf'(?<![\w.]){re.escape(name)}(?!\w)', text)]
    return f' ({"; ".join(places)})' if places else ''


def _lines(file: str) -> Iterator[tuple[str, int]]:
    """Yield every parameter of a file with its line, from 1."""
    try:
        root = yaml.compose(Path(file).read_text(encoding='utf-8'), Loader)
    except (OSError, ValueError, RecursionError, yaml.YAMLError):
        return  # rcl has said what is wrong with it
    for path, line in _keys(root):
        _, section, name = path.partition(SECTION)
        if section:
            yield name, line


def _keys(node: yaml.Node | None, path: str = '') -> Iterator[tuple[str, int]]:
    """Yield the keys of a YAML tree that have a value, with those above them, and their lines."""
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            name = f'{path}{key.value}'
            if isinstance(value, yaml.MappingNode):
                yield from _keys(value, f'{name}.')
            else:
                yield name, key.start_mark.line + 1
