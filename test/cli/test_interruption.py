"""Ctrl-C that waits until nothing is held."""
from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from typing import Iterator

import pytest
from qflsd_ros.cli.interruption import deferred


def interrupt(thread: threading.Thread) -> None:
    """Send SIGINT to one thread: one sent to a process may come when the test is over."""
    assert thread.ident is not None
    signal.pthread_kill(thread.ident, signal.SIGINT)


@pytest.fixture
def older() -> Iterator[threading.Thread]:
    """Give a thread that was there before the signal was held back."""
    over = threading.Event()
    thread = threading.Thread(target=over.wait)
    thread.start()
    yield thread
    over.set()
    thread.join()


def test_it_is_raised_where_it_is_asked_for_and_nowhere_else() -> None:
    """Nothing is raised between the signal and the check."""
    with pytest.raises(KeyboardInterrupt), deferred() as check:
        check()
        interrupt(threading.main_thread())
        later = True
        check()
    assert later


def test_it_is_seen_when_an_older_thread_has_got_it(older: threading.Thread) -> None:
    """As happens in a program that has threads: only those begun later hold it back, too."""
    with pytest.raises(KeyboardInterrupt), deferred() as check:
        interrupt(older)
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline:
            time.sleep(0.01)
            check()


def test_afterwards_all_is_as_before() -> None:
    """The handler and the mask; a signal that nobody asked about raises nothing later."""
    handler = signal.getsignal(signal.SIGINT)
    with deferred():
        interrupt(threading.main_thread())
    assert signal.getsignal(signal.SIGINT) is handler
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    assert not signal.sigpending()


def test_processes_started_within_do_not_see_it() -> None:
    """Even one that has only begun to start."""
    with deferred():
        child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(.5)'])
        child.send_signal(signal.SIGINT)
    assert child.wait(30) == 0
