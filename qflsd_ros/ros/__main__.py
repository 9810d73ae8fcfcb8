"""
The executables: ``python3 -m qflsd_ros.ros detector``, or ``camera``.

A node takes a second to import. Only this small file is there before an interrupt finds its way.
"""
from __future__ import annotations

from importlib import import_module
import signal
import sys


def camera() -> int:
    """Run the node ``camera``; return the exit code."""
    return _main('camera')


def detector() -> int:
    """Run the node ``detector``; return the exit code."""
    return _main('detector')


def _main(module: str) -> int:
    # Python's own handler would break in anywhere, in the midst of an import as well; without any,
    # an interrupt ends the process at once. From rclpy.init on, it ends the node.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return import_module(f'qflsd_ros.ros.{module}').main()


if __name__ == '__main__':
    sys.exit({'camera': camera, 'detector': detector}[sys.argv[1]]())
