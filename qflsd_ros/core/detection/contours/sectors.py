"""
The direction of the gradient at a pixel, as one of 16 sectors of 22.5 degrees.

Comparisons give the sector without an arc tangent, for many pixels at once.  Sectors end at
the multiples of 22.5 degrees, so that they determine the closest of the 8 neighbours exactly.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import inlined

# Bits of a sector, of which there are 16: dx > 0; dy > 0; |dx| >= |dy|; farther than 22.5 degrees
# from both axes.
RIGHT, DOWN, ALONG_X, SLANTED = 1, 2, 4, 8
SECTORS = 16

TAN_22 = np.uint32(round((math.sqrt(2) - 1) * 2 ** 16))     # of 22.5 degrees, in 1 / 2^16


def _bits(angle: float) -> int:
    """Return the sector that holds an angle, in radians from the x axis to the y axis."""
    x, y = math.cos(angle), math.sin(angle)
    slanted = min(abs(x), abs(y)) > math.tan(math.pi / 8) * max(abs(x), abs(y))
    return (RIGHT * (x > 0) + DOWN * (y > 0) + ALONG_X * (abs(x) >= abs(y)) + SLANTED * slanted)


# The sectors in order of their angle; POSITION is the inverse: the place of each in this order.
IN_ORDER = np.array([_bits((2 * i + 1) * math.pi / SECTORS) for i in range(SECTORS)], np.int64)
POSITION = np.argsort(IN_ORDER)


@inlined
def write_sectors(dx: np.ndarray, dy: np.ndarray, sectors: np.ndarray) -> None:
    """
    Write the sector of each gradient in a row.

    ``dx`` and ``dy`` are (W,) int16 of which none is -2^15, ``sectors`` is (W,) uint8.  All is in
    16 bits, of which the compiler does most at once.
    """
    for i in range(len(sectors)):
        x, y = np.uint16(abs(np.int16(dx[i]))), np.uint16(abs(np.int16(dy[i])))
        flat = np.uint16((np.uint32(x) * TAN_22) >> np.uint32(16))
        steep = np.uint16((np.uint32(y) * TAN_22) >> np.uint32(16))
        sectors[i] = np.uint8(np.uint16(dx[i] > 0) * np.uint16(RIGHT)
                              + np.uint16(dy[i] > 0) * np.uint16(DOWN)
                              + np.uint16(x >= y) * np.uint16(ALONG_X)
                              + np.uint16((y > flat) & (x > steep)) * np.uint16(SLANTED))
