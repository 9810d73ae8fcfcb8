"""
The executables: ``python3 -m qflsd_ros.ros detector``, ``detectors`` or ``camera``.

The imports of a node take about a second.  This file imports little, so that signals are handled
from the beginning.
"""
from __future__ import annotations

from importlib import import_module
import os
import signal
import sys
import threading

USAGE = 2  # exit code


def camera() -> int:
    """Run the node ``camera``; return the exit code."""
    return _node('camera')


def detector() -> int:
    """Run the node ``detector``; return the exit code."""
    return _node('detector')


def detectors() -> int:
    """Run the nodes of several cameras; return the exit code."""
    return _node('detectors')


def demo() -> int:
    """Run the command ``demo``; return the exit code."""
    return _run('demo', 'qflsd_ros.cli.demo')


def end_on_signals() -> None:
    """
    End the process with exit code 0 on SIGINT and SIGTERM, until rclpy.init takes both over.

    Python's own handler would raise KeyboardInterrupt anywhere, even within an import.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))


def _node(name: str) -> int:
    end_on_signals()
    code = _run(name, f'qflsd_ros.ros.{name}')
    if threading.active_count() > 1:
        # A thread still compiles or detects.  It cannot be interrupted, and would crash while the
        # interpreter shuts down.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


def _run(name: str, module: str) -> int:
    """Run the function ``main`` of a module; without ROS, print one line that says so."""
    try:
        main = import_module(module).main
    except ModuleNotFoundError as error:
        if (error.name or '').startswith('qflsd_ros'):
            raise
        print(f'{name}: the Python module {error.name} is not here: source ROS 2 Jazzy, or '
              "install it as wheels: pip install 'qflsd_ros[ros]'", file=sys.stderr)
        return USAGE
    return main()


def main() -> int:
    """Run the node that the command line names; return the exit code."""
    nodes = {'camera': camera, 'detector': detector, 'detectors': detectors}
    if sys.argv[1:2] and sys.argv[1] in nodes:
        return nodes[sys.argv[1]]()
    print(f'usage: python3 -m qflsd_ros.ros {"|".join(nodes)} [--ros-args ...]', file=sys.stderr)
    return USAGE


if __name__ == '__main__':
    sys.exit(main())
