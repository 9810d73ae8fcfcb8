"""The constants of the detector are varied, one in a process."""
from __future__ import annotations

from collections.abc import Iterator
import math
import multiprocessing
from multiprocessing.pool import Pool
from pathlib import Path

from benchmark.constants import Constant
from benchmark.datasets import View
from benchmark.experiments.sensitivity import run, Task
from benchmark.scenes.rendered import room
from benchmark.variation import change, NOT_VARIED, scaled, varied
import cv2
import numpy as np
import pytest
from qflsd_ros.core.detection import assembly, extension
from qflsd_ros.core.detection.contours import thresholds
from qflsd_ros.core.detection.joining import grid


def found(title: str) -> Constant:
    """Return a constant by its name."""
    return next(constant for constant in varied() if constant.title == title)


@pytest.fixture
def fresh() -> Iterator[Pool]:
    """Give a process in which nothing is compiled yet."""
    with multiprocessing.get_context('spawn').Pool(1) as pool:
        yield pool


def test_every_constant_that_is_left_out_exists() -> None:
    """A constant that was renamed or removed must not stay in the list."""
    everything = {constant.title for constant in varied(left_out=())}
    listed = {title for titles in NOT_VARIED.values() for title in titles}
    assert listed <= everything
    assert everything - listed == {constant.title for constant in varied()}


def test_names_are_unique() -> None:
    """A title stands for one constant."""
    titles = [constant.title for constant in varied()]
    assert len(titles) == len(set(titles)) > 40


@pytest.mark.parametrize(('source', 'value'), [
    ('2.0', 3.0), ('5', 8), ('(-4.0, 4.0)', (-6.0, 6.0)),
    ('math.sin(math.radians(10.0))', math.sin(math.radians(15)))])
def test_the_number_in_the_source_is_scaled(source: str, value: object) -> None:
    """An angle is scaled, not its sine; whole numbers stay whole."""
    product = scaled(Constant(grid.__name__, 'NAME', source, '', 1), 1.5)
    assert product == pytest.approx(value) and type(product) is type(value)


def test_derived_names_change_too(fresh: Pool) -> None:
    """A name that is computed from a constant follows it."""
    changed = fresh.apply(change, (found('thresholds.PIECES'), 1.3))
    assert changed == {(thresholds.__name__, 'PIECES'), (thresholds.__name__, 'SMALLEST')}


def test_importing_modules_change_too(fresh: Pool) -> None:
    """A name that is imported from the module of the constant follows it."""
    changed = fresh.apply(change, (found('extension.FARTHEST'), 1.3))
    assert changed == {(extension.__name__, 'FARTHEST'), (assembly.__name__, 'FARTHEST')}


def test_a_constant_is_varied_once(fresh: Pool, tmp_path: Path) -> None:
    """The kernel is compiled with the new value, and from then on refuses another one."""
    picture, path = room(0, -0.25, (120, 160)), tmp_path / 'room.png'
    cv2.imwrite(str(path), picture.gray)
    view = View('wide', path, picture.lines, np.zeros(len(picture.lines)), 'wide')
    lower = Task(found('validation.SCATTER'), 0.3, [view])
    usual = run(Task(None, 1.0, [view]))
    assert fresh.apply(run, (lower,)).f_measure < usual.f_measure
    with pytest.raises(RuntimeError, match='is compiled with the old'):
        fresh.apply(run, (lower,))
