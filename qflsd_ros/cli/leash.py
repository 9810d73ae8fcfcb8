"""
A node that ends with its parent process: it runs as long as its standard input is open.

The node is one of this package, by its name, or a program, by its path.
"""
from __future__ import annotations

import os
import runpy
import signal
import sys
from threading import Thread
import time

from qflsd_ros.ros.__main__ import end_on_signals, main as run

# s that the node has to end after SIGTERM, before it is killed: many times what it takes, and half
# of PATIENCE in cli/processes.py.
GRACE = 5.0
# The program of ``python -c START camera ...``. It removes the empty entry of sys.path, which
# stands for the current folder: files there must not be imported. Python 3.10 has no option for
# that.
START = ('import sys; sys.path = [entry for entry in sys.path if entry]; '
         'from qflsd_ros.cli.leash import main; sys.exit(main())')


def main() -> int:
    """Run the node that the command line names, and return its exit code."""
    end_on_signals()
    Thread(target=_end_with_input, name='leash', daemon=True).start()
    if sys.argv[1:] and sys.argv[1].endswith('.py'):
        runpy.run_path(sys.argv[1], run_name='__main__')
        return 0
    return run()


def _end_with_input() -> None:
    # The main thread may hold signals back while rclpy takes them over: leave them to it.
    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    while os.read(sys.stdin.fileno(), 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(GRACE)
    os._exit(1)
