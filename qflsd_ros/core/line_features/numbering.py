"""
Numbers of lines for readers that take a line with a number for unbroken over messages.

PL-VIO and its descendants assign the n-th observation of a number to the n-th frame after its
first: a number that is absent once and comes back would be assigned to wrong frames.  Therefore a
line that returns gets another number, and its track is given beside it.
"""
from __future__ import annotations

import numpy as np

LARGEST = 2**24     # exact in float32, in which the messages have numbers


class Numbering:
    """
    Numbers of the lines of successive messages.

    Lines are counted from 1 on, and again once the numbers are used up; a number that is in use
    then is left out.  Of several cameras, camera i numbers its k-th line ``k * cameras + i``: no
    two cameras share a number, since lines are not matched between cameras.
    """

    def __init__(self) -> None:
        """Begin without a line."""
        self._numbers: dict[int, int] = {}     # of the tracks in the last message
        self._next = 1

    @property
    def tracks(self) -> np.ndarray:
        """Return the tracks of the last message, (N,) int64."""
        return np.fromiter(self._numbers, np.int64, len(self._numbers))

    def take(self, tracks: np.ndarray, cameras: int, camera: int) -> np.ndarray:
        """
        Return the ids of the lines of the next message.

        Parameters
        ----------
        tracks
            (N,) int, different ones.
        cameras, camera
            Number of cameras, and which of them this is, from 0.

        Returns
        -------
        ids
            (N,) int64 below 2^24: each number times ``cameras``, plus ``camera``, as the readers
            decode it.

        """
        highest = LARGEST // cameras ** 2 - 1
        before, self._numbers = self._numbers, {}
        used = {number for number in map(before.get, tracks.tolist()) if number is not None}
        for track in tracks.tolist():
            number = before.get(track)
            self._numbers[track] = self._free(used, highest) if (
                number is None or number > highest) else number
        counts = np.fromiter(self._numbers.values(), np.int64, len(tracks))
        return (counts * cameras + camera) * cameras + camera

    def _free(self, used: set[int], highest: int) -> int:
        """Return the next number that is not used."""
        while True:
            number = self._next if self._next <= highest else 1
            self._next = number + 1
            if number not in used:
                return number
