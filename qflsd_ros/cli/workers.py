"""
Processes that work on one task after the other, and of which each may die.

Every process has a pipe of its own: it ends when that is closed, so none outlives whoever started
it; and when it is killed, the one task that it had is known.
"""
from __future__ import annotations

from contextlib import suppress
import multiprocessing
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
import signal
from typing import Any, Callable, Generic, Iterable, Iterator, TypeVar

from qflsd_ros.cli.interruption import held

Task, Result = TypeVar('Task'), TypeVar('Result')
SPAWN = multiprocessing.get_context('spawn')    # a fork would share OpenCV's threads


class Workers(Generic[Task, Result]):
    """Some processes; a context manager that leaves none of them behind."""

    def __init__(self, count: int, make: Callable[..., Callable[[Task], Result]],
                 *arguments: Any) -> None:
        """Start ``count`` processes when needed; each calls ``make`` for what does its work."""
        self._count, self._make, self._arguments = count, make, arguments
        self._processes: dict[Connection, BaseProcess] = {}
        self._tasks: dict[Connection, Task] = {}

    def __enter__(self) -> Workers[Task, Result]:
        """Return this."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End the processes: at once where an exception has come, else after their last task."""
        with held():
            for connection, process in self._processes.items():
                if kind is not None:
                    process.kill()
                connection.close()
            for process in self._processes.values():
                process.join()

    def run(self, tasks: Iterable[Task]) -> Iterator[tuple[Task, Result | None]]:
        """Yield every task, as it is done, with its result; None where its process has died."""
        for task in tasks:      # one at a time: frames of a video must not pile up
            self._give(task)
            if len(self._tasks) == self._count:
                yield from self._done()
        while self._tasks:
            yield from self._done()

    def _give(self, task: Task) -> None:
        """Send a task to a process that has none."""
        idle = [connection for connection in self._processes if connection not in self._tasks]
        connection = idle[0] if idle else self._start()
        self._tasks[connection] = task
        with suppress(OSError):     # it died while it was idle; its end of the pipe says so
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
        """Wait until some tasks are done, and yield them."""
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
    with suppress(EOFError, OSError):   # whoever started this has ended or wants no more
        while True:
            connection.send(work(connection.recv()))
