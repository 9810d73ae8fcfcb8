"""
Variation of the constants of the detector, one at a time.

The number in the source is varied: of the sine of an angle, the angle.

numba compiles constants into the kernels.  A constant can therefore be varied only once in a
process, and before the first frame.  Kernels that depend on it, directly or through kernels that
they call, are then compiled anew and not cached; all others come from the cache.
"""
from __future__ import annotations

import ast
from collections.abc import Collection, Iterator, Sequence
import importlib
import inspect
from types import ModuleType
from typing import Any

from benchmark.constants import bound, Constant, constants, modules
from qflsd_ros.core.kernels.kernel import Kernel

# Modules and packages that find the arcs of a frame without a lens.
DETECTOR = ('qflsd_ros.core.detector', 'qflsd_ros.core.circle', 'qflsd_ros.core.detection.')
NOT_VARIED = {
    'column numbers, layout of memory and technical limits': (
        'detector.SMALLEST_IMAGE', 'extraction.SECTION', 'grid.CELL', 'heap.ITEM',
        'pieces.NODES', 'order.GRAIN', 'suppression.CELL', 'suppression.ENTRIES'),
    'given by theory': ('gradients.GAIN',),
    'in use only with a known lens': (
        'frame.KNOWN_STD', 'agreement.BOW', 'agreement.BENT', 'agreement.EASE'),
    'in use only with a mask': ('region.SAMPLED',),
    'in use only with an image circle': (
        'image_circle.RAYS', 'image_circle.SMALLEST', 'image_circle.CORNER',
        'image_circle.SPREAD', 'image_circle.ALIKE', 'image_circle.STEP', 'image_circle.NOISES',
        'image_circle.SIDE', 'image_circle.GAP', 'image_circle.RISE', 'image_circle.END',
        'image_circle.LEAST_RADIUS', 'image_circle.OFF_CENTRE', 'image_circle.NEAR',
        'image_circle.ROUND', 'image_circle.SHOWN', 'image_circle.BEYOND',
        'image_circle.QUADRANT', 'image_circle.QUADRANTS', 'image_circle.FEWEST',
        'image_circle.ROUNDS', 'image_circle.COVERED', 'image_circle.TRUST')}
LEFT_OUT = frozenset(title for titles in NOT_VARIED.values() for title in titles)
Name = tuple[str, str]      # module, name in it


def scaled(constant: Constant, factor: float) -> Any:
    """Return the value of a constant with all numbers of its expression times a factor."""
    tree = _Scaling(factor).visit(ast.parse(constant.source, mode='eval'))
    code = compile(ast.fix_missing_locations(tree), constant.title, 'eval')
    return eval(code, vars(importlib.import_module(constant.module)))


class _Scaling(ast.NodeTransformer):
    """Multiplies numbers; whole ones stay whole."""

    def __init__(self, factor: float) -> None:
        self._factor = factor

    def visit_Constant(self, node: ast.Constant) -> ast.Constant:
        """Return the node of the product."""
        assert isinstance(node.value, (int, float))
        value = node.value * self._factor
        return ast.Constant(round(value) if isinstance(node.value, int) else value)


def varied(left_out: Collection[str] = LEFT_OUT) -> list[Constant]:
    """
    Return the constants of the detector that can be varied, but for those left out.

    Their expression is a number, a tuple of numbers, or a function of one number.
    """
    return [constant for constant in constants()
            if constant.module.startswith(DETECTOR) and _can_vary(constant.source)
            and constant.title not in left_out]


def _can_vary(source: str) -> bool:
    """Return whether an expression is a number, a tuple of numbers, or a function of one."""
    value = ast.parse(source, mode='eval').body
    literals = [node for node in ast.walk(value) if isinstance(node, ast.Constant)]
    names = [node.id for node in ast.walk(value) if isinstance(node, ast.Name)]
    return not any(map(str.isupper, names)) and (
        len(literals) == 1 or len(literals) > 1 and isinstance(value, ast.Tuple))


def change(constant: Constant, factor: float) -> set[Name]:
    """
    Scale a constant in this process, and all that the core derives from it when it is imported.

    Returns the names that have changed; RuntimeError where a kernel that depends on one of them
    is compiled already.
    """
    changed = {(constant.module, constant.name)}
    setattr(importlib.import_module(constant.module), constant.name, scaled(constant, factor))
    core = modules()
    before: set[Name] = set()
    while before != changed:
        before = set(changed)
        for module in core:
            changed |= set(_renewed(module, before))
    _compile_anew(core, changed)
    return changed


def _renewed(module: ModuleType, changed: set[Name]) -> Iterator[Name]:
    """Import and compute again what a module takes from changed names; return its new names."""
    home = module.__name__
    for statement in ast.parse(inspect.getsource(module)).body:
        if isinstance(statement, ast.ImportFrom) and statement.module:
            for alias in statement.names:
                name = alias.asname or alias.name
                if (statement.module, alias.name) in changed and (home, name) not in changed:
                    source = importlib.import_module(statement.module)
                    setattr(module, name, getattr(source, alias.name))
                    yield home, name
        for name, value in bound(statement):
            if (home, name) not in changed and changed & set(_uses(value, module)):
                setattr(module, name, eval(ast.unparse(value), vars(module)))
                yield home, name


def _uses(value: ast.AST, module: ModuleType) -> Iterator[Name]:
    """Return the global names that code in a module refers to, by the module that has them."""
    for node in ast.walk(value):
        if isinstance(node, ast.Name):
            yield module.__name__, node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            owner = vars(module).get(node.value.id)
            if isinstance(owner, ModuleType):
                yield owner.__name__, node.attr


def _compile_anew(core: Sequence[ModuleType], changed: set[Name]) -> None:
    """Take the cache from all kernels that depend on changed names."""
    kernels: dict[Name, Any] = {
        (module.__name__, name): value for module in core
        for name, value in vars(module).items() if isinstance(value, Kernel)}
    uses = {place: set(_uses(ast.parse(inspect.getsource(kernel.py_func)),
                             importlib.import_module(kernel.py_func.__module__)))
            for place, kernel in kernels.items()}
    affected: set[Name] = set()
    while more := {place for place in kernels.keys() - affected
                   if uses[place] & (changed | affected)}:
        affected |= more
    for place in affected:
        if kernels[place].versions:
            raise RuntimeError(f'{".".join(place)} is compiled with the old value of a constant')
        kernels[place].is_kept = False
