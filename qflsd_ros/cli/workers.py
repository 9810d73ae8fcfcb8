"""
Worker processes: each takes one task after the other, and the loss of one costs only its task.

Each process has a pipe of its own. It ends when the pipe is closed, so it does not outlive its
parent; and the parent knows which task a killed process had.
"""
from __future__ import annotations

from contextlib import suppress
import multiprocessing
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
import signal
from typing import Any, Callable, Generic, Iterable, Iterator, TypeVar

from qflsd_ros.cli.interruption import held

Task = TypeVar('Task')
Result = TypeVar('Result')
SPAWN = multiprocessing.get_context('spawn')    # OpenCV's threads do not survive a fork


class Workers(Generic[Task, Result]):
    """A fixed number of worker processes; a context manager that ends them on leaving."""

    def __init__(self, count: int, make: Callable[..., Callable[[Task], Result]],
                 *arguments: Any) -> None:
        """
        Start up to ``count`` processes as tasks arrive.

        Each process calls ``make(*arguments)`` once, and the function that this returns with
        every task.
        """
        self._count, self._make, self._arguments = count, make, arguments
        self._processes: dict[Connection, BaseProcess] = {}
        self._tasks: dict[Connection, Task] = {}

    def __enter__(self) -> Workers[Task, Result]:
        """Return the pool; processes start when tasks arrive."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End the processes: at once after an exception, else after their last task."""
        with held():
            for connection, process in self._processes.items():
                if kind is not None:
                    process.kill()
                connection.close()
            for process in self._processes.values():
                process.join()

    def run(self, tasks: Iterable[Task]) -> Iterator[tuple[Task, Result | None]]:
        """Yield each finished task with its result, or None where its process was killed."""
        for task in tasks:      # one at a time, so that the frames of a video need little memory
            self._give(task)
            if len(self._tasks) == self._count:
                yield from self._done()
        while self._tasks:
            yield from self._done()

    def _give(self, task: Task) -> None:
        """Send a task to an idle process, or to a new one."""
        idle = [connection for connection in self._processes if connection not in self._tasks]
        connection = idle[0] if idle else self._start()
        self._tasks[connection] = task
        with suppress(OSError):     # the idle process was killed: _done finds the pipe closed
            connection.send(task)

    def _start(self) -> Connection:
        with held():
            ours, theirs = SPAWN.Pipe()
            process = SPAWN.Process(target=_serve, args=(theirs, self._make, self._arguments),
                                    daemon=True)
            process.start()
            theirs.close()
            self._processes[ours] = process
        return ours

    def _done(self) -> Iterator[tuple[Task, Result | None]]:
        """Wait until one task or more are finished, and yield them."""
        for connection in wait(list(self._tasks)):
            assert isinstance(connection, Connection)
            try:
                result = connection.recv()
            except (EOFError, OSError):
                result = None
                connection.close()
                self._processes.pop(connection).join()
            yield self._tasks.pop(connection), result


def _serve(connection: Connection, make: Callable[..., Callable[[Any], Any]],
           arguments: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    work = make(*arguments)
    with suppress(EOFError, OSError):   # the parent has ended or has closed the pipe
        while True:
            connection.send(work(connection.recv()))
