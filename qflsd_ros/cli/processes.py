"""Processes that end with whoever started them."""
from __future__ import annotations

import signal
import subprocess
from typing import Mapping, Sequence

PATIENCE = 10.0  # s for a process to end by itself after SIGINT


class ProcessError(Exception):
    """A process that failed; ``code`` is its exit code, 1 where a signal ended it."""

    def __init__(self, name: str, code: int) -> None:
        how = f'with exit code {code}' if code > 0 else f'by {signal.Signals(-code).name}'
        super().__init__(f'the {name} ended {how}')
        self.code = max(1, code)


class Processes:
    """
    Named processes, started on entering and ended on leaving: by SIGINT, else by SIGKILL.

    Each has a process group of its own: a Ctrl-C reaches it in this way alone. Its standard input
    stays open as long as this process lives, however that may end: :mod:`qflsd_ros.cli.leash`.
    """

    def __init__(self, commands: Mapping[str, Sequence[str]]) -> None:
        """Take the command line of each process by its name."""
        self._commands = commands
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Processes:
        """Start them."""
        try:
            for name, command in self._commands.items():
                self._processes[name] = subprocess.Popen(
                    command, start_new_session=True, stdin=subprocess.PIPE)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """End them, whatever they do."""
        for process in self._processes.values():
            process.send_signal(signal.SIGINT)
        for process in self._processes.values():
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def running(self) -> bool:
        """Tell whether all still run; ProcessError where one has failed."""
        codes = {name: process.poll() for name, process in self._processes.items()}
        for name, code in codes.items():
            if code:
                raise ProcessError(name, code)
        return None in codes.values() and 0 not in codes.values()
