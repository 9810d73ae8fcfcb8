"""The kernels of a node: loaded, or compiled at the first start ever, while it answers already."""
from __future__ import annotations

from concurrent.futures import Future
from threading import Thread
import time
from typing import Callable

from qflsd_ros.core import compilation
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

POLL_PERIOD, LOG_PERIOD = 1.0, 5.0  # s


class Kernels:
    """
    The compilation of a node's kernels, by a thread of its own.

    A compiler cannot be interrupted: a process that ends meanwhile must not wait for the thread.
    """

    def __init__(self, node: Node, package: str, warm_up: Callable[[], None],
                 then: Callable[[], None] = lambda: None) -> None:
        """
        Call ``warm_up`` in a thread, and ``then`` in the node's executor afterwards.

        ``package`` holds the kernels that ``warm_up`` compiles. What it raises, the executor does.
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
        """How far the compilation is, or None where nothing has been compiled yet, or all is."""
        compiled, kernels = compilation.progress(self._package)
        if self.ready or not compiled:
            return None
        return f'compiling kernels: {compiled} of {kernels}'

    def _work(self, warm_up: Callable[[], None]) -> None:
        try:
            warm_up()
        except BaseException as error:
            self._warmed.set_exception(error)
        else:
            self._warmed.set_result(None)
        if self._node.context.ok():
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
            kept = f'kept in {folder}' if folder else 'kept nowhere'
            self._node.get_logger().info(f'{text} ({kept}; in all about half a minute)',
                                         throttle_duration_sec=LOG_PERIOD)
