"""A kernel has a version for each combination of argument types."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from qflsd_ros.core.kernels.kernel import type_of


class Pair(NamedTuple):
    first: object
    second: object


class Other(NamedTuple):
    first: object
    second: object


def read_only(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array


SQUARE = np.zeros((4, 4))
DIFFERENT = [
    1, 1.0, True, None, np.float32(1), np.int32(1), SQUARE, SQUARE[0], SQUARE[:, ::2],
    np.asfortranarray(SQUARE), SQUARE.astype(np.float32), SQUARE.astype('>f8'),
    read_only(np.zeros((4, 4))), (1, 1), (1, 1.0), (1, 1, 1), Pair(1, 1), Other(1, 1),
    Pair(1, SQUARE), Pair(1, SQUARE[0]), (Pair(1, 1), 1)]


def test_what_needs_other_code_has_another_type() -> None:
    assert len({type_of(value) for value in DIFFERENT}) == len(DIFFERENT)


@pytest.mark.parametrize('a, b', [
    (1, -2 ** 40), (1, np.int64(1)), (1.0, np.float64(1)), (True, np.bool_(True)),
    (SQUARE, np.ones((9, 7))), (SQUARE[:, ::2], np.ones((9, 7))[::3, ::3]),
    (Pair(1, SQUARE), Pair(2, np.ones((1, 1))))])
def test_values_and_sizes_do_not_matter(a: object, b: object) -> None:
    assert type_of(a) == type_of(b)
