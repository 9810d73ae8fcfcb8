"""Ctrl-C while worker processes run: noted at once, acted upon where nothing is held."""
from __future__ import annotations

from contextlib import contextmanager
import signal
from typing import Callable, Iterator


@contextmanager
def deferred() -> Iterator[Callable[[], None]]:
    """
    Hold SIGINT back, from processes that are started within as well.

    A KeyboardInterrupt amid the locks of a pool of processes, or in a worker that still imports,
    leaves the others waiting for ever.

    :returns: a function that raises KeyboardInterrupt if SIGINT has come
    """
    noted: list[int] = []

    def check() -> None:
        # Threads that are older than the mask may have taken the signal.
        if noted or signal.SIGINT in signal.sigpending():
            raise KeyboardInterrupt

    handler = signal.signal(signal.SIGINT, lambda number, frame: noted.append(number))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited by processes
    try:
        yield check
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, handler)
