"""Signals that ask a command to end: noted for later, or raised as an exception."""
from __future__ import annotations

from contextlib import contextmanager
import signal
from types import FrameType
from typing import Callable, Iterator

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupted(BaseException):
    """A signal asks the command to end; ``number`` is the number of the signal."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


def noted(*numbers: signal.Signals) -> Callable[[], None]:
    """
    Note signals from now on; return a function that raises KeyboardInterrupt after a signal.

    The handler itself must not raise: rclpy turns an exception that is raised while it converts a
    message into another error, and the end of child processes must not be interrupted.
    """
    came: list[int] = []
    for number in numbers:
        signal.signal(number, lambda number, _: came.append(number))

    def check() -> None:
        if came:
            raise KeyboardInterrupt

    return check


class _Held:
    """The number of callers that hold signals back, and the signal that has come meanwhile."""

    depth = 0
    came: int | None = None


@contextmanager
def raised() -> Iterator[None]:
    """Raise :class:`Interrupted` for each signal of :data:`ENDING` that is not ignored already."""
    before = {number: signal.getsignal(number) for number in ENDING}
    for number, handler in before.items():
        if handler != signal.SIG_IGN:
            signal.signal(number, _interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def held() -> Iterator[None]:
    """
    Delay :class:`Interrupted` until the end of the block, so that the block is done completely.

    Processes that are started in the block never receive the SIGINT of Ctrl-C.
    """
    # The mask alone does not suffice: another thread, without it, may receive the signal, and
    # Python then runs the handler in the main thread.
    _Held.depth += 1
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        _Held.depth -= 1
        if _Held.came is not None and not _Held.depth:
            number, _Held.came = _Held.came, None
            raise Interrupted(number)


def _interrupt(number: int, _: FrameType | None) -> None:
    if _Held.depth:
        _Held.came = number
    else:
        raise Interrupted(number)
