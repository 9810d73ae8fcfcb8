"""
ROS parameter files, read as rcl and rclpy read them; imports no ROS.

A file has sections, each for the nodes whose full name its own name matches: ``*`` stands for one
part of a name, ``**`` for any number of them.  A name that does not begin with a slash gets one,
and namespaces may be nested.  Of all sections that match, the later one wins, however specific the
others are; where a section stands is where its name comes first.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
import re
from typing import Any, Iterator

import yaml

SECTION = 'ros__parameters'
WILDCARDS = {'/**': r'(/\w+)*', '*': r'\w+'}
LIMIT = 1 << 20     # bytes; a file of every parameter has some 10 thousand
TRUE = {'Y', 'y', 'yes', 'Yes', 'YES', 'true', 'True', 'TRUE', 'on', 'On', 'ON'}
FALSE = {'N', 'n', 'no', 'No', 'NO', 'false', 'False', 'FALSE', 'off', 'Off', 'OFF'}
INTEGER = re.compile(r'[+-]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)')
DECIMAL = re.compile(r'[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?')
NOT_FINITE = re.compile(r'[+-]?(\.?inf|infinity|nan)|\.nan', re.IGNORECASE)
STRING = 'tag:yaml.org,2002:str'


class FileError(ValueError):
    """A parameter file that cannot be read; the text says in a line what and where."""


@dataclass
class Section:
    """
    What a file says of the nodes that a name matches.

    Attributes
    ----------
    values
        By name of the parameter; names within names are joined by dots.
    lines
        From 1, of the same.

    """

    values: dict[str, Any] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)


class Loader(yaml.BaseLoader):
    """
    YAML as far as ROS takes it: without aliases (``*name``).

    rcl takes none, and a dozen lines of them can stand for gigabytes.
    """

    def compose_node(self, parent: yaml.Node | None, index: yaml.Node | int | None) -> yaml.Node:
        """Return the next node, with its tag as written; yaml.YAMLError where it is an alias."""
        event = self.peek_event()
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError(f'line {event.start_mark.line + 1}: alias *{event.anchor}: '
                                 'a ROS parameter file has none, write out what it stands for')
        node = super().compose_node(parent, index)
        node.tag = event.tag
        return node


def read(path: Path) -> dict[str, Section]:
    """
    Return the sections of a file by their names, in order.

    Raises
    ------
    FileError
        The file cannot be read, or is no ROS parameter file.

    """
    try:
        with path.open('rb') as file:
            content = file.read(LIMIT + 1)
        if len(content) > LIMIT:
            raise FileError(f'has more than {LIMIT} bytes')
        sections: dict[str, Section] = {}
        for document in yaml.compose_all(content.decode('utf-8'), Loader):
            for name, line, node in _sections(document, ''):
                section = sections.setdefault(name if name[0] == '/' else f'/{name}', Section())
                for parameter, line, value in _parameters(node, ''):
                    section.values[parameter], section.lines[parameter] = value, line
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        what = error.strerror if isinstance(error, OSError) else ' '.join(str(error).split())
        raise FileError(f'{path}: cannot be read: {what}') from error
    return sections


def matches(name: str, node: str) -> bool:
    """Tell whether a section's name matches the full name of a node."""
    pattern = ''.join(WILDCARDS.get(part, re.escape(part))
                      for part in re.split(r'(/\*\*|\*)', name))
    return re.fullmatch(pattern, node) is not None


def merged(sections: dict[str, Section], node: str) -> Section | None:
    """Return what sections say of a node, of its full name; None where none of them matches."""
    found = [section for name, section in sections.items() if matches(name, node)]
    if not found:
        return None
    result = Section()
    for section in found:
        result.values |= section.values
        result.lines |= section.lines
    return result


def unmatched(path: Path, sections: dict[str, Section], node: str) -> str:
    """Say in a line that no section of a file matches a node."""
    names = ', '.join(sections) or 'none at all'
    return (f'{path}: no section matches the node {node}, all of it is ignored: it has {names}; '
            f'/** matches any node')


def _sections(node: yaml.Node, above: str) -> Iterator[tuple[str, int, yaml.Node]]:
    """Yield the name of every section, its line and what it holds."""
    if not isinstance(node, yaml.MappingNode):
        raise FileError(f'line {node.start_mark.line + 1}: must have the layout of a ROS '
                        f'parameter file: "/**:", below it "{SECTION}:", below that '
                        '"name: value" lines')
    for key, value in node.value:
        line = key.start_mark.line + 1
        name = _name(key)
        if not name.startswith(SECTION):
            yield from _sections(value, f'{above}/{name}' if above else name)
        elif not above or not isinstance(value, yaml.MappingNode):
            raise FileError(f'line {line}: {SECTION} must stand below the name of a node, and '
                            '"name: value" lines below it')
        else:
            yield above, line, value


def _parameters(node: yaml.MappingNode, above: str) -> Iterator[tuple[str, int, Any]]:
    for key, value in node.value:
        name = f'{above}.{_name(key)}' if above else _name(key)
        if isinstance(value, yaml.MappingNode):
            yield from _parameters(value, name)
        else:
            yield name, key.start_mark.line + 1, _value(value)


def _name(key: yaml.Node) -> str:
    if not isinstance(key, yaml.ScalarNode) or not key.value:
        raise FileError(f'line {key.start_mark.line + 1}: must have a name before the colon')
    return key.value


def _value(node: yaml.Node) -> Any:
    """Return a value as rcl understands it, which is not quite as YAML has it: 1e3 is a number."""
    if isinstance(node, yaml.SequenceNode):
        return [_value(value) for value in node.value]
    if not isinstance(node, yaml.ScalarNode):
        raise FileError(f'line {node.start_mark.line + 1}: a list must hold values alone')
    text, quoted = node.value, node.style in ('"', "'")
    if not text and not quoted:
        raise FileError(f'line {node.start_mark.line + 1}: has no value')
    return text if quoted or node.tag == STRING else _plain(text)


def _plain(text: str) -> bool | int | float | str:
    if text in TRUE or text in FALSE:
        return text in TRUE
    if INTEGER.fullmatch(text):
        digits = text.lstrip('+-')
        octal = len(digits) > 1 and digits[0] == '0' and digits[1] not in 'xX'
        number = int(text, 8 if octal else 0)
        return number if -2 ** 63 <= number < 2 ** 63 else float(number)
    if DECIMAL.fullmatch(text):
        number = float(text)
        # What is too large or too small for a number stays text.
        small = number == 0 and re.search('[1-9]', text.lower().partition('e')[0])
        return text if small or abs(number) == float('inf') else number
    return float(text.replace('.', '')) if NOT_FINITE.fullmatch(text) else text
