"""The lines of parameter files that set a parameter, which rcl does not report; imports no ROS."""
from __future__ import annotations

from pathlib import Path
import re
from typing import Iterator, Sequence

from qflsd_ros.ros.parameters import file as parameter_file
from qflsd_ros.ros.parameters.file import FileError, Section


def origin(text: str, arguments: Sequence[str]) -> str:
    """
    Return the lines of parameter files that set the parameters named in a text.

    ``arguments`` is the command line.  The result is ' (FILE, line N; ...)', or an empty text if
    no file sets one of them.
    """
    places = [f'{file}, line {line}' for file, sections in files(arguments)
              for section in sections.values() for name, line in section.lines.items()
              if re.search(rf'(?<![\w.]){re.escape(name)}(?!\w)', text)]
    return f' ({"; ".join(places)})' if places else ''


def unmatched(arguments: Sequence[str], node: str, siblings: Sequence[str] = ()
              ) -> Iterator[str]:
    """
    Yield a message for each parameter file of a command line without a section for a node.

    A file with a section for one of ``siblings`` is not meant for all nodes.
    """
    for file, sections in files(arguments):
        if all(parameter_file.merged(sections, name) is None for name in (node, *siblings)):
            yield parameter_file.unmatched(Path(file), sections, node)


def files(arguments: Sequence[str]) -> Iterator[tuple[str, dict[str, Section]]]:
    """Yield the readable parameter files of a command line, each with its sections."""
    for flag, file in zip(arguments, arguments[1:]):
        if flag == '--params-file':
            try:
                yield file, parameter_file.read(Path(file))
            except FileError:
                pass  # rcl itself reports the error
