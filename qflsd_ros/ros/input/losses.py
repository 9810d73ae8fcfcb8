"""The number of frames lost on their way, by the sequence numbers of their publishers."""
from __future__ import annotations

from typing import Callable


class Losses:
    """
    Counts the frames missing between those that arrive.

    The middleware gives the sequence number of a frame, but not its publisher, and two publishers
    on one topic number their frames independently.  A gap in the numbers therefore counts only
    while the topic has one publisher and keeps it.  At any other time, only the losses that the
    middleware reports itself count.
    """

    def __init__(self, publishers: Callable[[], frozenset[bytes]]) -> None:
        """Take a function that returns the identifiers of the topic's present publishers."""
        self._find_publishers = publishers
        self.restart()

    def restart(self) -> None:
        """Forget the last sequence number, and look up the publishers again."""
        self._publishers = self._find_publishers()
        self._number: int | None = None

    def missing(self, number: int | None) -> int:
        """
        Return the number of frames missing between the last frame and this one.

        ``number`` is the sequence number of this frame; None if the middleware gives none.
        """
        last, self._number = self._number, number
        if last is None or number is None or number <= last + 1 or len(self._publishers) > 1:
            return 0
        # Another publisher may have taken over before the middleware reports the change.
        before, self._publishers = self._publishers, self._find_publishers()
        return number - last - 1 if len(before) == 1 and self._publishers == before else 0

    def reported(self, count: int) -> int:
        """Return how many of ``count`` losses that the middleware reports no gap will show."""
        shown = self._number is not None and len(self._publishers) == 1
        return 0 if shown else count
