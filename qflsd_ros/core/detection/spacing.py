"""Evenly spaced places that are the same from both ends."""
from __future__ import annotations

from qflsd_ros.core.compilation import inlined


@inlined
def place(i: int, room: int, steps: int) -> int:
    """
    Return i / steps of the room in whole px or points, for i of 0 to ``steps``, above 0.

    Place i from one end is place i from the other, but for the middle one of an odd room.
    """
    return i * room // steps if 2 * i <= steps else room - (steps - i) * room // steps
