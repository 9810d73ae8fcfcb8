"""The constants of the detector are found in its source, and varied in a process."""
from __future__ import annotations

from collections.abc import Callable
import math
import multiprocessing
from typing import Any

from benchmark.constants import change, Constant, constants, NOT_VARIED
from benchmark.scenes.rendered import room
import numpy as np
import pytest
from qflsd_ros.core import Detector
from qflsd_ros.core.detection import grid, suppression, thresholds


def found(title: str) -> Constant:
    """Return a constant by its name."""
    return next(constant for constant in constants() if constant.title == title)


def in_a_process(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function in a fresh process, in which nothing is compiled yet."""
    with multiprocessing.get_context('spawn').Pool(1) as pool:
        return pool.apply(function, arguments)


def test_every_constant_that_is_left_out_exists() -> None:
    """A constant that was renamed or removed must not stay in the list."""
    everything = {constant.title for constant in constants(left_out=())}
    listed = {title for titles in NOT_VARIED.values() for title in titles}
    assert listed <= everything
    assert everything - listed == {constant.title for constant in constants()}


def test_names_are_unique() -> None:
    """A title stands for one constant."""
    titles = [constant.title for constant in constants()]
    assert len(titles) == len(set(titles)) > 40


@pytest.mark.parametrize(('source', 'value'), [
    ('2.0', 3.0), ('5', 8), ('(-4.0, 4.0)', (-6.0, 6.0)),
    ('math.sin(math.radians(10.0))', math.sin(math.radians(15)))])
def test_the_number_in_the_source_is_scaled(source: str, value: object) -> None:
    """An angle is scaled, not its sine; whole numbers stay whole."""
    scaled = Constant(grid.__name__, 'NAME', source).scaled(1.5)
    assert scaled == pytest.approx(value) and type(scaled) is type(value)


def arcs_with(title: str, factor: float) -> tuple[set[tuple[str, str]], int]:
    """Return the names that change with a constant, and the number of arcs then."""
    changed = change(found(title), factor)
    return changed, len(Detector().detect(room(0, -0.25, (240, 320)).gray))


def test_a_constant_changes_the_arcs() -> None:
    """Suppression that hides fewer arcs leaves more: the kernel is compiled with the constant."""
    usual = len(Detector().detect(room(0, -0.25, (240, 320)).gray))
    changed, more = in_a_process(arcs_with, 'suppression.HIDDEN', 1.6)
    assert changed == {(suppression.__name__, 'HIDDEN')} and more > usual
    assert in_a_process(arcs_with, 'suppression.HIDDEN', 1.0)[1] == usual


def test_derived_names_change_too() -> None:
    """A name computed from a constant or imported from its module follows it."""
    changed, _ = in_a_process(arcs_with, 'thresholds.PIECES', 1.3)
    assert changed >= {(thresholds.__name__, 'PIECES'), (thresholds.__name__, 'SMALLEST')}


def test_a_compiled_kernel_is_refused() -> None:
    """A constant that a kernel was compiled with cannot be varied any more."""
    with pytest.raises(AssertionError, match='is compiled with the old constant'):
        in_a_process(vary_after_a_frame)


def vary_after_a_frame() -> None:
    """Detect, then vary."""
    Detector().detect(np.tile(np.uint8([0, 255]), (32, 16)))
    change(found('suppression.HIDDEN'), 1.3)
