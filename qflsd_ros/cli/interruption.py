"""Ctrl-C and the like: noted at once, acted upon where nothing is held."""
from __future__ import annotations

from contextlib import contextmanager
import signal
from typing import Callable, Iterator


def noted(*numbers: signal.Signals) -> Callable[[], None]:
    """
    Note signals from now on; return a function that raises KeyboardInterrupt once one has come.

    Raised while rclpy takes a message over, it comes out as another error; and processes are to be
    ended without interruption.
    """
    came: list[int] = []
    for number in numbers:
        signal.signal(number, lambda number, _: came.append(number))

    def check() -> None:
        if came:
            raise KeyboardInterrupt

    return check


@contextmanager
def deferred() -> Iterator[Callable[[], None]]:
    """
    Hold SIGINT back, from processes that are started within as well.

    A KeyboardInterrupt amid the locks of a pool of processes, or in a worker that still imports,
    leaves the others waiting for ever.

    :returns: a function that raises KeyboardInterrupt if SIGINT has come
    """
    handler = signal.getsignal(signal.SIGINT)
    came = noted(signal.SIGINT)

    def check() -> None:
        came()      # to a thread that is older than the mask
        if signal.SIGINT in signal.sigpending():
            raise KeyboardInterrupt

    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited by processes
    try:
        yield check
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, handler)
