"""The frames of a camera that are due at a lower rate, by their stamps."""
from __future__ import annotations

NS = 10**9         # nanoseconds in a second


class Pace:
    """
    Chooses the frames closest to regular times.

    At a rate that divides that of the camera, it is every k-th frame.  The times begin with the
    first frame, and anew where the rate changes, where a frame is missing for longer than a
    period, and where a stamp does not advance; such a frame is always due.
    """

    def __init__(self) -> None:
        """Begin without a frame."""
        self._rate = 0.0
        self._last = self._due = 0      # ns

    def due(self, stamp: int, rate: float) -> bool:
        """
        Return whether the next frame is due.

        Parameters
        ----------
        stamp
            Its stamp, ns.
        rate
            Frames per second of stamps; 0 takes every frame.

        """
        if rate == 0:
            self._rate = 0.0
            return True
        period, interval, self._last = NS / rate, stamp - self._last, stamp
        if rate != self._rate or interval <= 0 or stamp - self._due > period:
            self._rate, self._due = rate, stamp + round(period)
            return True
        # Half an interval later, the next frame is no closer.
        if stamp + interval / 2 < self._due:
            return False
        self._due += round(period)
        return True
