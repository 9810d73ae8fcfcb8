"""Evenly spaced places that are the same from both ends."""
from __future__ import annotations

from qflsd_ros.core.compilation import inlined


@inlined
def place(i: int, room: int, steps: int) -> int:
    """
    Return i / steps of ``room``, rounded to an integer, for 0 <= i <= steps and steps > 0.

    Places are symmetric: place i from one end equals place i from the other end, except for the
    middle one of an odd room.
    """
    return i * room // steps if 2 * i <= steps else room - (steps - i) * room // steps
