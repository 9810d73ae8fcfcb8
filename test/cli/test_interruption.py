"""Ctrl-C that waits until nothing is held."""
from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest
from qflsd_ros.cli.interruption import deferred


def test_it_is_raised_where_it_is_asked_for_and_nowhere_else() -> None:
    """Nothing is raised between the signal and the check."""
    with pytest.raises(KeyboardInterrupt), deferred() as check:
        check()
        os.kill(os.getpid(), signal.SIGINT)
        later = True
        check()
    assert later


def test_afterwards_all_is_as_before() -> None:
    """The handler and the mask; a signal that nobody asked about raises nothing later."""
    handler = signal.getsignal(signal.SIGINT)
    with deferred():
        os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is handler
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    assert not signal.sigpending()


def test_processes_started_within_do_not_see_it() -> None:
    """Even one that has only begun to start."""
    with deferred():
        child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(.5)'])
        child.send_signal(signal.SIGINT)
    assert child.wait(30) == 0
