"""
ROS parameter files, interpreted as rcl and rclpy do; imports no ROS.

A file consists of sections.  The name of a section is a pattern for full names of nodes: ``*``
matches one part of a name, ``**`` any number of parts.  A name without a leading slash gets one,
and namespaces may be nested.  If several sections match a node, later ones override earlier ones,
however specific they are; the position of a section is that of the first use of its name.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
import re
from typing import Any, Iterator

import yaml

SECTION = 'ros__parameters'
WILDCARDS = {'/**': r'(/\w+)*', '*': r'\w+'}
LIMIT = 1 << 20     # bytes; a file with every parameter has about 10 thousand
TRUE = {'Y', 'y', 'yes', 'Yes', 'YES', 'true', 'True', 'TRUE', 'on', 'On', 'ON'}
FALSE = {'N', 'n', 'no', 'No', 'NO', 'false', 'False', 'FALSE', 'off', 'Off', 'OFF'}
INTEGER = re.compile(r'[+-]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)')
DECIMAL = re.compile(r'[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?')
NOT_FINITE = re.compile(r'[+-]?(\.?inf|infinity|nan)|\.nan', re.IGNORECASE)
STRING = 'tag:yaml.org,2002:str'


class FileError(ValueError):
    """A parameter file cannot be read; the text is one line that names the file and the error."""


@dataclass
class Section:
    """
    The parameters of the nodes that match one name.

    Attributes
    ----------
    values
        Values by the name of the parameter; nested names are joined by dots.
    lines
        Line numbers of the same parameters, from 1.

    """

    values: dict[str, Any] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)


class Loader(yaml.BaseLoader):
    """
    YAML without aliases (``*name``).

    rcl refuses aliases, and a dozen lines of them can expand to gigabytes.
    """

    # The annotations of PyYAML call these arguments less general than they are.
    def compose_node(self, parent: Any, index: Any) -> yaml.Node:
        """Return the next node with its tag as written; yaml.YAMLError if it is an alias."""
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError(f'line {_line(event)}: alias *{event.anchor}: a ROS parameter '
                                 'file must not have aliases, write the value itself')
        node: Any = super().compose_node(parent, index)
        node.tag = event.tag
        return node


def read(path: Path) -> dict[str, Section]:
    """
    Return the sections of a file by their names, in the order of the file.

    Raises
    ------
    FileError
        The file cannot be read, or is not a ROS parameter file.

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
    """Return whether the name of a section matches the full name of a node."""
    pattern = ''.join(WILDCARDS.get(part, re.escape(part))
                      for part in re.split(r'(/\*\*|\*)', name))
    return re.fullmatch(pattern, node) is not None


def merged(sections: dict[str, Section], node: str) -> Section | None:
    """Return the parameters of a node, given its full name; None if no section matches."""
    found = [section for name, section in sections.items() if matches(name, node)]
    if not found:
        return None
    result = Section()
    for section in found:
        result.values |= section.values
        result.lines |= section.lines
    return result


def unmatched(path: Path, sections: dict[str, Section], node: str) -> str:
    """Return the message that no section of a file matches a node."""
    names = ', '.join(sections) or 'none at all'
    return (f'{path}: no section matches the node {node}, all of it is ignored: it has {names}; '
            f'/** matches any node')


def _line(position: yaml.Node | yaml.Event) -> int:
    """Return the line on which a node or an event begins, from 1."""
    assert position.start_mark is not None  # every one that is read from a file has a mark
    return position.start_mark.line + 1


def _sections(node: yaml.Node, above: str) -> Iterator[tuple[str, int, yaml.MappingNode]]:
    """Yield name, line and content of each section; ``above`` is the namespace around it."""
    if not isinstance(node, yaml.MappingNode):
        raise FileError(f'line {_line(node)}: must have the layout of a ROS '
                        f'parameter file: "/**:", below it "{SECTION}:", below that '
                        '"name: value" lines')
    for key, value in node.value:
        line = _line(key)
        name = _name(key)
        if not name.startswith(SECTION):
            yield from _sections(value, f'{above}/{name}' if above else name)
        elif not above or not isinstance(value, yaml.MappingNode):
            raise FileError(f'line {line}: {SECTION} must stand below the name of a node, and '
                            '"name: value" lines below it')
        else:
            yield above, line, value


def _parameters(node: yaml.MappingNode, above: str) -> Iterator[tuple[str, int, Any]]:
    """Yield name, line and value of each parameter; ``above`` is the name around it."""
    for key, value in node.value:
        name = f'{above}.{_name(key)}' if above else _name(key)
        if isinstance(value, yaml.MappingNode):
            yield from _parameters(value, name)
        else:
            yield name, _line(key), _value(value)


def _name(key: yaml.Node) -> str:
    if not isinstance(key, yaml.ScalarNode) or not key.value:
        raise FileError(f'line {_line(key)}: must have a name before the colon')
    return key.value


def _value(node: yaml.Node) -> Any:
    """Return a value as rcl interprets it, which differs from YAML: 1e3 is a number."""
    if isinstance(node, yaml.SequenceNode):
        return [_value(value) for value in node.value]
    if not isinstance(node, yaml.ScalarNode):
        raise FileError(f'line {_line(node)}: a list must contain only values')
    text, quoted = node.value, node.style in ('"', "'")
    if not text and not quoted:
        raise FileError(f'line {_line(node)}: has no value')
    return text if quoted or node.tag == STRING else _plain(text)


def _plain(text: str) -> bool | int | float | str:
    """Return the value of a text without quotes."""
    if text in TRUE or text in FALSE:
        return text in TRUE
    if INTEGER.fullmatch(text):
        digits = text.lstrip('+-')
        octal = len(digits) > 1 and digits[0] == '0' and digits[1] not in 'xX'
        whole = int(text, 8 if octal else 0)
        return whole if -2 ** 63 <= whole < 2 ** 63 else float(whole)
    if DECIMAL.fullmatch(text):
        number = float(text)
        # A number out of the range of float64 stays a text.
        too_small = number == 0 and re.search('[1-9]', text.lower().partition('e')[0])
        return text if too_small or abs(number) == float('inf') else number
    return float(text.replace('.', '')) if NOT_FINITE.fullmatch(text) else text
