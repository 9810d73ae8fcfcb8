"""The node's report on its tracks, for /diagnostics; imports no ROS."""
from __future__ import annotations

from threading import Lock
import time
from typing import Callable

import numpy as np
from qflsd_ros.core.arcs import Arcs


class TrackStatistics:
    """Counts of tracks; :meth:`follow` and :meth:`take` may be called from two threads."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Take a monotonic clock, a function that returns a time in s."""
        self._lock, self._clock = Lock(), clock
        self._begin = clock()
        self._newest: np.ndarray | None = None  # table of the last frame, None without tracking
        self._new = self._lost = 0

    def follow(self, arcs: Arcs) -> None:
        """Count the tracks of the next frame."""
        with self._lock:
            before, self._newest = self._newest, arcs.table if arcs.is_tracked else None
            if before is not None and self._newest is not None:
                self._lost += int((~np.isin(before['track'], self._newest['track'])).sum())
            if self._newest is not None:
                self._new += int((self._newest['age'] == 1).sum())

    def take(self) -> dict[str, str]:
        """Return keys and values of diagnostics since the last call; none without tracking."""
        with self._lock:
            now = self._clock()
            period, self._begin = max(now - self._begin, 1e-9), now
            new, lost, self._new, self._lost = self._new, self._lost, 0, 0
            if self._newest is None:
                return {}
            age = f'{np.median(self._newest["age"]):.0f}' if len(self._newest) else 'nan'
            return {'tracks': str(len(self._newest)),
                    'track age median (frames)': age,
                    'tracks new (1/s)': f'{new / period:.1f}',
                    'tracks lost (1/s)': f'{lost / period:.1f}'}
