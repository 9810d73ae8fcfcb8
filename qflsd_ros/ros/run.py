"""Running a node from its start to its exit code."""
from __future__ import annotations

import signal
import sys
from typing import Callable, Protocol

from qflsd_ros.ros.parameters.declaration import ParameterError
from qflsd_ros.ros.parameters.origin import origin
from qflsd_ros.sources.frames import SourceError
import rclpy
from rclpy.exceptions import NotInitializedException, ParameterException
from rclpy.executors import ExternalShutdownException

USAGE = 2  # exit code


class Runnable(Protocol):
    """A node with a main loop."""

    def run(self) -> None:
        """Work until the node is shut down or its work is finished."""


def run(name: str, make: Callable[[], Runnable]) -> int:
    """
    Make a node and run it until SIGINT, SIGTERM or its own end; return the exit code.

    If ``make`` raises ParameterError, SourceError or an exception of rclpy about an argument, the
    process prints one line on stderr that begins with ``name``, and the exit code is 2.
    """
    try:
        _made(make).run()
    except (ParameterError, SourceError) as error:
        print(f'{name}: {error}{origin(str(error), sys.argv)}', file=sys.stderr)
        return USAGE
    except RuntimeError:
        if rclpy.ok():
            raise
        # A signal arrived while a message was being published.
    except (ExternalShutdownException, NotInitializedException):
        pass  # NotInitializedException: a signal arrived before the node existed.
    finally:
        rclpy.try_shutdown()
    return 0


def _made(make: Callable[[], Runnable]) -> Runnable:
    try:
        _init()
    except RuntimeError as error:
        cure = ''
        if 'log directory' in str(error):
            cure = ': set ROS_LOG_DIR to a writable folder'
        raise ParameterError(f'{type(error).__name__}: {error}{cure}') from error
    try:
        return make()
    except (ParameterException, RuntimeError) as error:
        if not rclpy.ok():
            raise ExternalShutdownException from error
        raise ParameterError(f'{type(error).__name__}: {error}') from error


def _init() -> None:
    """Initialise rclpy, which handles SIGINT and SIGTERM from then on, and lose no signal."""
    # rclpy also calls the handler that it replaces, so it must replace none.  A signal that came
    # before rclpy's handler is there would kill the process: it waits until then.
    signals = signal.SIGINT, signal.SIGTERM
    signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        for number in signals:
            signal.signal(number, signal.SIG_DFL)
        rclpy.init()
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)
