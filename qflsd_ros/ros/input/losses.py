"""How many frames were published and never came, by the numbers that publishers give them."""
from __future__ import annotations

from typing import Callable


class Losses:
    """
    Counts the frames that are missing between those that come.

    The middleware says which number a frame has, and not whose: two publishers on one topic number
    their frames each on its own.  So a gap counts while there is one publisher, and the same one;
    at any other time only what the middleware reports itself does.
    """

    def __init__(self, publishers: Callable[[], frozenset[bytes]]) -> None:
        """Take what returns the identifiers of all that publish on the topic now."""
        self._look = publishers
        self.begin_anew()

    def begin_anew(self) -> None:
        """Begin with the next frame, by whoever publishes now."""
        self._publishers = self._look()
        self._number: int | None = None

    def missing(self, number: int | None) -> int:
        """
        Return how many frames are missing between the last one and this.

        ``number`` is the frame's, as its publisher counts; None where the middleware does not.
        """
        last, self._number = self._number, number
        if last is None or number is None or number <= last + 1 or len(self._publishers) > 1:
            return 0
        # One may have taken over from another before the middleware says that anything changed.
        before, self._publishers = self._publishers, self._look()
        return number - last - 1 if len(before) == 1 and self._publishers == before else 0

    def reported(self, count: int) -> int:
        """Return how many of the frames that the middleware reports lost no gap shows."""
        shown = self._number is not None and len(self._publishers) == 1
        return 0 if shown else count
