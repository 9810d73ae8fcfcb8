"""Child processes that end with this process."""
from __future__ import annotations

import signal
import subprocess
from typing import Mapping, Sequence

# s for a process to end by itself after SIGINT; it takes 1 s, on a busy machine some.
PATIENCE = 10.0


class ProcessError(Exception):
    """A process has failed; ``code`` is its exit code, or 1 where a signal has ended it."""

    def __init__(self, name: str, code: int) -> None:
        how = f'with exit code {code}' if code > 0 else f'by {signal.Signals(-code).name}'
        super().__init__(f'the {name} ended {how}')
        self.code = max(1, code)


class Processes:
    """
    Named processes, started on entering and ended on leaving: by SIGINT, then by SIGKILL.

    Each is in a session of its own, so that Ctrl-C in the terminal does not reach it directly.
    Its standard input is a pipe that closes when this process ends, even by SIGKILL; see
    :mod:`qflsd_ros.cli.leash`.
    """

    def __init__(self, commands: Mapping[str, Sequence[str]]) -> None:
        """Take the command line of each process by its name."""
        self._commands = commands
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Processes:
        """Start the processes."""
        try:
            for name, command in self._commands.items():
                self._processes[name] = subprocess.Popen(
                    command, start_new_session=True, stdin=subprocess.PIPE)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """End the processes, by SIGKILL those that do not end within :data:`PATIENCE`."""
        for process in self._processes.values():
            process.send_signal(signal.SIGINT)
        for process in self._processes.values():
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def running(self) -> bool:
        """Return whether all processes run; raise ProcessError where one has failed."""
        codes = {name: process.poll() for name, process in self._processes.items()}
        for name, code in codes.items():
            if code:
                raise ProcessError(name, code)
        return None in codes.values() and 0 not in codes.values()
