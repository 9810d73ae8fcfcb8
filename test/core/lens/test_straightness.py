"""Straightness of arcs through a lens: probable for edges, not for wheels, unknown for others."""
from __future__ import annotations

import numpy as np
import pytest
from qflsd_ros.core import Arcs, DivisionModel, with_straightness
from qflsd_ros.core.lens.straightness import straightness
from seen import arcs_of, edges, wheels

LENS = DivisionModel(-0.3, (480, 640))


def test_straightness_is_a_column_of_the_table():
    curves = edges(LENS, 10, 1) + wheels(LENS, 5, 2) + [edges(LENS, 1, 3)[0][:9]]
    arcs = arcs_of(curves)
    found = with_straightness(arcs, LENS)
    assert np.array_equal(found.table['straight'], straightness(arcs, LENS), equal_nan=True)
    assert (found.table['straight'][:10] > 0.9).all()
    assert (found.table['straight'][10:15] < 0.1).all()
    assert np.isnan(found.table['straight'][15])
    for name in arcs.table.dtype.names:
        assert np.array_equal(found.table[name], arcs.table[name])
    assert found.polylines()[3] == pytest.approx(arcs.polylines()[3])
    assert np.isnan(with_straightness(arcs, None).table['straight']).all()
    assert len(straightness(Arcs.empty(), LENS)) == 0
