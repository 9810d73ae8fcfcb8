"""Real processes over real DDS: each test has its own domain, and polls instead of sleeping."""
from __future__ import annotations

from contextlib import contextmanager, suppress
import fcntl
import gc
import itertools
import os
from pathlib import Path
import re
import signal
import socket
import subprocess
import sys
import time
from typing import Any, Callable, Iterator

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

ROOT = Path(__file__).parents[2]
TIMEOUT = 60.0  # s; generous: the machine may be busy, and kernels may have to be compiled
FAREWELL = 1.0  # s, many times what the middleware takes to tell that a node has left
SETTLED = 60.0  # s after which an unheld lock belongs to a dead process
# Wheels in a virtual environment have no setup file that would set this.
os.environ.setdefault('AMENT_PREFIX_PATH', sys.prefix)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'


class Process:
    """A Python module that runs as a process; ``output`` is the text that it has printed."""

    def __init__(self, arguments: list[str], environment: dict[str, str], log: Path) -> None:
        self.log = log
        with log.open('w') as stream:
            self.popen = subprocess.Popen([sys.executable, *arguments], cwd=ROOT, stdout=stream,
                                          stderr=subprocess.STDOUT, env=os.environ | environment)

    @property
    def output(self) -> str:
        return self.log.read_text()

    def stop(self, with_signal: int = signal.SIGINT) -> int:
        """Send a signal and return the exit code."""
        self.popen.send_signal(with_signal)
        return self.wait()

    def wait(self) -> int:
        """Return the exit code."""
        return self.popen.wait(TIMEOUT)


class Peer:
    """The node of the test in one domain, and the processes under test."""

    def __init__(self, domain: int, folder: Path) -> None:
        self.environment = {'ROS_DOMAIN_ID': str(domain), 'ROS_LOG_DIR': str(folder)}
        self.folder = folder
        self.context = Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self.node = Node('peer', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.processes: list[Process] = []

    def run(self, *arguments: str, **environment: str) -> Process:
        """Start ``python <arguments>`` in the peer's domain."""
        log = self.folder / f'process{len(self.processes)}.log'
        self.processes.append(Process(list(arguments), self.environment | environment, log))
        return self.processes[-1]

    def until(self, condition: Callable[[], Any], meanwhile: Callable[[], Any] = lambda: None,
              period: float = 0.05, timeout: float = TIMEOUT) -> Any:
        """Spin until a condition is true; return its value. Call ``meanwhile`` once a period."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            meanwhile()
            pause = time.monotonic() + period
            while time.monotonic() < pause:
                self.executor.spin_once(max(pause - time.monotonic(), 0))
                if result := condition():
                    return result
        outputs = '\n'.join(process.output for process in self.processes)
        raise AssertionError(f'not within {timeout} s; the processes say:\n{outputs}')

    def call(self, type_: type, service: str, **request: Any) -> Any:
        """Call a service and return its response."""
        client = self.node.create_client(type_, service)
        self.until(client.service_is_ready)
        future = client.call_async(type_.Request(**request))
        self.until(future.done)
        self.node.destroy_client(client)
        return future.result()

    def close(self) -> None:
        """End all processes and the node."""
        self._see_off()
        for process in self.processes:
            process.popen.kill()
            process.popen.wait()
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def _see_off(self) -> None:
        """
        Wait until the nodes of processes that have ended are gone from the graph.

        Fast DDS may hang or crash where it is told of one that leaves while it ends itself.  A
        killed process tells nobody, and some nodes end without a word.
        """
        running = sum(process.popen.poll() is None for process in self.processes)
        if running < len(self.processes):
            with suppress(AssertionError):
                self.until(lambda: len(self.node.get_node_names()) <= 1 + running,
                           timeout=FAREWELL)


@pytest.fixture(scope='session', autouse=True)
def swept_memory() -> Iterator[None]:
    """Remove the shared memory of killed processes, like ``fastdds shm clean``."""
    yield
    for lock in Path('/dev/shm').glob('fastrtps_*_el'):
        if re.fullmatch('fastrtps_[0-9a-f]{16}_el', lock.name):
            with suppress(OSError), lock.open() as file:
                if time.time() - lock.stat().st_mtime < SETTLED:
                    continue  # its owner may be about to lock it
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # fails while the owner lives
                lock.with_name(lock.name.removesuffix('_el')).unlink(missing_ok=True)
                lock.unlink()


def free_domains() -> Iterator[tuple[int, socket.socket]]:
    """Yield ROS domains that no other test run uses, each with the port that reserves it."""
    for i in itertools.count(os.getpid()):
        domain = 1 + i % 100  # above 101, Linux hands the ports out to others
        lock = socket.socket()
        try:
            lock.bind(('127.0.0.1', 22119 + domain))
        except OSError:
            lock.close()
            continue
        yield domain, lock


domains = free_domains()


@contextmanager
def reserved_domain() -> Iterator[int]:
    """Yield a domain that nobody else has meanwhile."""
    number, lock = next(domains)
    try:
        yield number
    finally:
        lock.close()


@pytest.fixture
def domain() -> Iterator[int]:
    """Give one test a domain of its own."""
    with reserved_domain() as number:
        yield number


def make_peer(folder: Path) -> Iterator[Peer]:
    """Yield a peer in a domain of its own."""
    with reserved_domain() as number:
        peer = Peer(number, folder)
        yield peer
        peer.close()


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[Peer]:
    """Give one test a peer of its own."""
    yield from make_peer(tmp_path)


@pytest.fixture(scope='module')
def module_peer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Peer]:
    """Give the tests of a module one peer that they share."""
    yield from make_peer(tmp_path_factory.mktemp('peer'))


@pytest.fixture
def refuse(peer: Peer, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
           ) -> Iterator[Callable[..., str]]:
    """Give a function that starts a node within this process, and returns why it ends at once."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for name, value in peer.environment.items():
        monkeypatch.setenv(name, value)

    def start(main: Callable[[], int], *arguments: str) -> str:
        monkeypatch.setattr(sys, 'argv', ['node', '--ros-args', *arguments])
        assert main() == 2
        gc.collect()  # the node leaves now, not at any time later
        said = capfd.readouterr().err
        assert len(said.splitlines()) == 1, said
        return said

    yield start
    for number, handler in handlers.items():
        signal.signal(number, handler)
