"""
The few classes of the packages launch and launch_ros that the launch file uses.

There are no wheels of these packages.  The fakes take the arguments of the real ones and no
others, and :func:`commands` gives the command lines that launch_ros's ``Node`` would run.
"""
from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
import runpy
import sys
from types import ModuleType
from typing import Any, Union

Arguments = Mapping[str, str]


@dataclass(frozen=True)
class LaunchConfiguration:
    """The value of an argument."""

    variable_name: str

    def perform(self, given: Arguments) -> str:
        return given[self.variable_name]


@dataclass(frozen=True)
class FindPackageShare:
    """The share folder of a package; for this package, the root of the repository."""

    package: str

    def perform(self, given: Arguments) -> str:
        assert self.package == 'qflsd_ros'
        return str(Path(__file__).parents[2])


@dataclass(frozen=True)
class PathJoinSubstitution:
    """A path joined from its parts."""

    substitutions: Sequence[Any]

    def perform(self, given: Arguments) -> str:
        return str(Path(*(text(part, given) for part in self.substitutions)))


Substitution = Union[str, LaunchConfiguration, FindPackageShare, PathJoinSubstitution]
Text = Union[Substitution, Sequence[Substitution]]


def text(value: Text, given: Arguments) -> str:
    """Return the text behind a substitution, or behind a list of them."""
    if isinstance(value, str):
        return value
    if isinstance(value, (list, tuple)):
        return ''.join(text(part, given) for part in value)
    return value.perform(given)


@dataclass(frozen=True)
class DeclareLaunchArgument:
    """An argument on the command line."""

    name: str
    default_value: Text | None = None
    description: str | None = None
    choices: list[str] | None = None


@dataclass(frozen=True)
class IfCondition:
    """An action is left out unless its condition is true."""

    predicate_expression: Text

    def evaluate(self, given: Arguments) -> bool:
        return {'true': True, '1': True, 'false': False, '0': False}[
            text(self.predicate_expression, given).lower()]


@dataclass(frozen=True)
class Node:
    """A process with a ROS node in it."""

    package: Text
    executable: Text
    name: Text | None = None
    namespace: Text | None = None
    parameters: list[Text] = field(default_factory=list)
    remappings: list[tuple[Text, Text]] = field(default_factory=list)
    arguments: list[Text] = field(default_factory=list)
    condition: IfCondition | None = None
    respawn: Text | bool = False
    respawn_delay: float | None = None
    output: str = 'log'

    def command(self, given: Arguments) -> list[str]:
        """Return package, executable and arguments, in the order in which Node gives them."""
        line = [text(value, given) for value in (self.package, self.executable, *self.arguments)]
        line.append('--ros-args')
        if self.name is not None:
            line += ['-r', f'__node:={text(self.name, given)}']
        if self.namespace is not None:
            line += ['-r', f'__ns:=/{text(self.namespace, given).lstrip("/")}']
        for file in self.parameters:
            line += ['--params-file', text(file, given)]
        for old, new in self.remappings:
            line += ['-r', f'{text(old, given)}:={text(new, given)}']
        return line


@dataclass(frozen=True)
class LaunchDescription:
    """The actions of a launch file."""

    entities: Sequence[DeclareLaunchArgument | Node]

    def given(self, arguments: Arguments) -> Arguments:
        """Return the values of all arguments; raise RuntimeError for one that is refused."""
        declared = {entity.name: entity for entity in self.entities
                    if isinstance(entity, DeclareLaunchArgument)}
        if unknown := set(arguments) - set(declared):
            raise RuntimeError(f'unknown: {unknown}')
        values: dict[str, str] = {}
        for name, argument in declared.items():
            assert argument.default_value is not None
            values[name] = arguments.get(name, text(argument.default_value, values))
            if argument.choices is not None and values[name] not in argument.choices:
                raise RuntimeError(f'{name} is one of {argument.choices}, not {values[name]!r}')
        return values

    def nodes(self, given: Arguments) -> list[Node]:
        """Return the nodes whose condition holds."""
        return [entity for entity in self.entities if isinstance(entity, Node)
                and (entity.condition is None or entity.condition.evaluate(given))]


MODULES = {
    'launch': [LaunchDescription], 'launch.actions': [DeclareLaunchArgument],
    'launch.conditions': [IfCondition],
    'launch.substitutions': [LaunchConfiguration, PathJoinSubstitution],
    'launch_ros': [], 'launch_ros.actions': [Node], 'launch_ros.substitutions': [FindPackageShare]}


@contextmanager
def in_place_of_launch() -> Iterator[None]:
    """Make ``import launch`` and ``import launch_ros`` find the fakes."""
    before = dict(sys.modules)
    for name, classes in MODULES.items():
        module = ModuleType(name)
        vars(module).update({one.__name__: one for one in classes})
        sys.modules[name] = module
    try:
        yield
    finally:
        for name in MODULES:
            del sys.modules[name]
        sys.modules.update((name, before[name]) for name in MODULES if name in before)


def description(file: Path) -> LaunchDescription:
    """Return the launch description of a launch file, made of the fakes."""
    with in_place_of_launch():
        return runpy.run_path(str(file))['generate_launch_description']()


def commands(file: Path, **arguments: str) -> list[list[str]]:
    """Return the command lines of a launch file: package, executable and arguments of each."""
    launched = description(file)
    given = launched.given(arguments)
    return [node.command(given) for node in launched.nodes(given)]
