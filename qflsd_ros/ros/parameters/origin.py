"""Where a parameter was set: rcl reads parameter files and does not tell; imports no ROS."""
from __future__ import annotations

from pathlib import Path
import re
from typing import Iterator, Sequence

from qflsd_ros.ros.parameters import file as parameter_file
from qflsd_ros.ros.parameters.file import FileError, Section


def origin(text: str, arguments: Sequence[str]) -> str:
    """
    Say which lines of parameter files set the parameters that a text names.

    ``arguments`` is the command line.  Returns ' (FILE, line N)', or nothing where no file does.
    """
    places = [f'{file}, line {line}' for file, sections in files(arguments)
              for section in sections.values() for name, line in section.lines.items()
              if re.search(rf'(?<![\w.]){re.escape(name)}(?!\w)', text)]
    return f' ({"; ".join(places)})' if places else ''


def unmatched(arguments: Sequence[str], node: str) -> Iterator[str]:
    """Yield a line for every parameter file of a command line that says nothing of a node."""
    for file, sections in files(arguments):
        if parameter_file.merged(sections, node) is None:
            yield parameter_file.unmatched(Path(file), sections, node)


def files(arguments: Sequence[str]) -> Iterator[tuple[str, dict[str, Section]]]:
    """Yield the parameter files of a command line that can be read, each with its sections."""
    for flag, file in zip(arguments, arguments[1:]):
        if flag == '--params-file':
            try:
                yield file, parameter_file.read(Path(file))
            except FileError:
                pass  # rcl has said what is wrong with it
