"""Sectors: each direction of a gradient in one of 16, exactly."""
from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from qflsd_ros.core.detection.contours import sectors

LARGEST = 2 ** 15 - 1
rows = st.lists(st.tuples(st.integers(-LARGEST, LARGEST), st.integers(-LARGEST, LARGEST)),
                min_size=1, max_size=70)


@given(rows)
def test_a_sector_holds_its_gradient(gradients):
    dx, dy = np.array(gradients, np.int16).T
    found = np.empty(len(dx), np.uint8)
    sectors.write_sectors(dx, dy, found)
    angles = np.arctan2(dy.astype(float), dx.astype(float))
    middles = (2 * sectors.POSITION[found] + 1) * np.pi / sectors.SECTORS
    off = np.abs((angles - middles + np.pi) % (2 * np.pi) - np.pi)
    # TAN_22 has 16 bits, which moves the limit at 22.5 degrees by less than 1e-5.
    assert (off[(dx != 0) | (dy != 0)] <= np.pi / sectors.SECTORS + 1e-5).all()


def test_each_sector_occurs_once_around():
    angles = np.arange(0.5, sectors.SECTORS) * 2 * np.pi / sectors.SECTORS
    found = np.empty(sectors.SECTORS, np.uint8)
    sectors.write_sectors(np.int16(1000 * np.cos(angles)), np.int16(1000 * np.sin(angles)), found)
    assert found.tolist() == sectors.IN_ORDER.tolist()
