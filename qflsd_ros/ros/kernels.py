"""Loading or compiling a node's kernels in the background, while it answers services."""
from __future__ import annotations

from concurrent.futures import Future
from contextlib import suppress
from threading import Thread
import time
from typing import Callable

from qflsd_ros.core import compilation
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node

COMPILING = 'compiling kernels'     # begins the text on the progress
POLL_PERIOD, LOG_PERIOD = 1.0, 5.0  # s; about twelve lines in a compilation of a minute


class Kernels:
    """
    The compilation of a node's kernels, in a thread of its own.

    The compiler cannot be interrupted, so a process that ends must not wait for the thread.

    Attributes
    ----------
    ready
        Whether all kernels can be used.

    """

    def __init__(self, node: Node, package: str, warm_up: Callable[[], None],
                 then: Callable[[], None] = lambda: None) -> None:
        """
        Call ``warm_up`` in a thread, and afterwards ``then`` in the node's executor.

        ``package`` is the name of the package whose kernels ``warm_up`` compiles.  The executor
        raises any exception of ``warm_up``.
        """
        self._node, self._package, self._then = node, package, then
        self._begin = time.monotonic()
        self._warmed: Future[None] = Future()
        self._finished = node.create_guard_condition(self._finish)
        self._timer = node.create_timer(POLL_PERIOD, self._log,
                                        clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.ready = False
        Thread(target=self._work, args=(warm_up,), name='kernels', daemon=True).start()

    @property
    def compiling(self) -> str | None:
        """Progress of the compilation as a text; None before it begins and after it ends."""
        compiled, kernels = compilation.progress(self._package)
        if self.ready or not compiled:
            return None
        return f'{COMPILING}: {compiled} of {kernels}'

    def _work(self, warm_up: Callable[[], None]) -> None:
        try:
            warm_up()
        except BaseException as error:
            self._warmed.set_exception(error)
        else:
            self._warmed.set_result(None)
        if self._node.context.ok():
            with suppress(InvalidHandle):   # the node has ended meanwhile
                self._finished.trigger()

    def _finish(self) -> None:
        self._warmed.result()
        if compiled := compilation.progress(self._package).compiled:
            self._node.get_logger().info(
                f'compiled {compiled} kernels in {time.monotonic() - self._begin:.0f} s')
        self.ready = True
        self._timer.cancel()
        self._then()

    def _log(self) -> None:
        if text := self.compiling:
            folder = compilation.STORE.folder
            kept = f'kept in {folder}' if folder else 'not kept'
            self._node.get_logger().info(f'{text} ({kept}; takes about a minute in all)',
                                         throttle_duration_sec=LOG_PERIOD)
