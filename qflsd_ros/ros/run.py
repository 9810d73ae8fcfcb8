"""Run a node until it is told to end, and say in one line why it cannot start."""
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
    """A node that knows how to work."""

    def run(self) -> None:
        """Work until the node is shut down, or to the end of the work."""


def run(name: str, make: Callable[[], Runnable]) -> int:
    """
    Make a node and run it, until SIGINT, SIGTERM or its own end; return the exit code.

    ``make`` may raise ParameterError or SourceError, and whatever rclpy raises for an argument
    that cannot be used: one line on stderr, with ``name`` in front, and exit code 2.
    """
    try:
        _made(make).run()
    except (ParameterError, SourceError) as error:
        print(f'{name}: {error}{origin(str(error), sys.argv)}', file=sys.stderr)
        return USAGE
    except RuntimeError:
        if rclpy.ok():
            raise
        # The signal came while a message was being published.
    except (ExternalShutdownException, NotInitializedException):
        pass  # NotInitializedException: the signal came before the node was there.
    finally:
        rclpy.try_shutdown()
    return 0


def _made(make: Callable[[], Runnable]) -> Runnable:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)  # rclpy calls what was there before, too
    try:
        rclpy.init()
    except RuntimeError as error:
        cure = ''
        if 'log directory' in str(error):
            cure = ': set ROS_LOG_DIR to a folder that can be written'
        raise ParameterError(f'{type(error).__name__}: {error}{cure}') from error
    try:
        return make()
    except (ParameterException, RuntimeError) as error:
        if not rclpy.ok():
            raise ExternalShutdownException from error
        raise ParameterError(f'{type(error).__name__}: {error}') from error
