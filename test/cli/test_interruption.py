"""Signals that ask to end are an exception, but not while something is held."""
from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from typing import Iterator

import pytest
from qflsd_ros.cli.interruption import ENDING, held, Interrupted, raised


@pytest.fixture(autouse=True)
def heard() -> Iterator[None]:
    """Give every signal a handler that is not to ignore it, as a shell may have it."""
    before = {number: signal.signal(number, signal.SIG_DFL) for number in ENDING}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize('number', ENDING)
def test_a_signal_is_raised_with_its_number(number: signal.Signals) -> None:
    with pytest.raises(Interrupted, match=number.name) as caught, raised():
        os.kill(os.getpid(), number)
        time.sleep(10)
    assert caught.value.number == number


@pytest.mark.parametrize('number', ENDING)
def test_it_waits_while_something_is_held(number: signal.Signals) -> None:
    done = []
    with pytest.raises(Interrupted), raised():
        with held():
            with held():
                os.kill(os.getpid(), number)
                time.sleep(0.05)
            done.append('within')
        done.append('after')
    assert done == ['within']


def test_it_waits_though_an_older_thread_has_got_it() -> None:
    """As happens in a program that has threads: only those begun later inherit a mask."""
    over, done = threading.Event(), []
    thread = threading.Thread(target=over.wait)
    thread.start()
    assert thread.ident is not None
    with pytest.raises(Interrupted), raised():
        with held():
            signal.pthread_kill(thread.ident, signal.SIGINT)
            time.sleep(0.2)
            done.append('within')
        done.append('after')
    over.set()
    thread.join()
    assert done == ['within']


def test_it_is_not_lost_where_something_fails_meanwhile() -> None:
    with pytest.raises(Interrupted), raised(), held():
        os.kill(os.getpid(), signal.SIGTERM)
        raise OSError


def test_afterwards_all_is_as_before_and_what_is_ignored_stays_so() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with raised(), held():
        os.kill(os.getpid(), signal.SIGHUP)
    assert [signal.getsignal(number) for number in ENDING] == [
        signal.SIG_DFL, signal.SIG_DFL, signal.SIG_IGN]
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    assert not signal.sigpending()


def test_processes_started_within_do_not_see_it() -> None:
    """Even one that has only begun to start."""
    with held():
        child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(.5)'])
        child.send_signal(signal.SIGINT)
    assert child.wait(30) == 0
