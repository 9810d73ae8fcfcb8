"""Signals that ask to end: noted, or raised as an exception where nothing is held."""
from __future__ import annotations

from contextlib import contextmanager
import signal
from types import FrameType
from typing import Callable, Iterator

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupted(BaseException):
    """A signal has come that asks to end; ``number`` is its own."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


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


class _Held:
    """How many callers hold signals back, and which one came meanwhile."""

    depth = 0
    came: int | None = None


@contextmanager
def raised() -> Iterator[None]:
    """Raise :class:`Interrupted` for any of :data:`ENDING` that is not ignored already."""
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
    Hold :class:`Interrupted` back until what is done within is done whole.

    Processes that are started within never get a signal that goes to the whole terminal.
    """
    # A mask alone would not do: a thread that is older gets the signal, and passes it on.
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
