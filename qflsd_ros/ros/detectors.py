"""
The executable ``detectors``: the detectors of several cameras in one process.

Each camera has a node ``detector`` in a namespace of its own, with an executor in a thread of its
own: the wait of an executor costs time in proportion to the entities of all its nodes, and an
exception in a callback ends the nodes of one executor alone.  Kernels are loaded once.

A node ``detectors`` holds the parameter ``cameras``, and waits for the end.
"""
from __future__ import annotations

from collections.abc import Sequence
import re
import sys
from threading import Thread
import time
import traceback

from qflsd_ros.ros.detector import CLOSE_TIMEOUT, DetectorNode
from qflsd_ros.ros.parameters.declaration import ParameterError
from qflsd_ros.ros.parameters.origin import origin
from qflsd_ros.ros.run import run
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.validate_namespace import validate_namespace

LOOK_PERIOD = 1.0   # s until the process ends after its last camera has; short for whoever waits
EXPECTED = ": must be a list of namespaces, such as ['front', 'left']"
NOT_FOR_CAMERAS = re.compile(r'(__(node|name|ns)|cameras):=')


class DetectorsNode(Node):
    """
    Starts a detector for each camera.

    Raises
    ------
    ParameterError
        The parameter ``cameras`` cannot be used, or none of the cameras can be started.

    """

    def __init__(self) -> None:
        super().__init__('detectors')
        namespaces = _namespaces(self._cameras(), self.get_namespace())
        names = self.get_fully_qualified_name(), *(f'{each}/detector' for each in namespaces)
        nodes = [node for namespace in namespaces
                 if (node := self._start(namespace, names)) is not None]
        if not nodes:
            raise ParameterError('no camera can be started, for the reasons logged above')
        self._threads = [Thread(target=self._follow, args=(node,), daemon=True,
                                name=node.get_namespace()) for node in nodes]

    def run(self) -> None:
        """Work until the process is to end, or until no camera is left."""
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self)
        # Also bounds the wait, which misses a signal that comes just before it begins.
        self.create_timer(LOOK_PERIOD, lambda: None,
                          clock=Clock(clock_type=ClockType.STEADY_TIME))
        for thread in self._threads:
            thread.start()
        try:
            while any(thread.is_alive() for thread in self._threads):
                executor.spin_once()
        finally:
            end = time.monotonic() + CLOSE_TIMEOUT
            for thread in self._threads:
                thread.join(max(0.0, end - time.monotonic()))
        if self.context.ok():
            raise RuntimeError('no camera is left, for the reasons logged above')

    def _cameras(self) -> Sequence[str]:
        try:
            return self.declare_parameter(
                'cameras', RosParameter.Type.STRING_ARRAY, ParameterDescriptor(
                    read_only=True, description='Namespaces of the cameras, each of which gets a '
                    'node detector.')).value or []
        except ParameterException as error:
            raise ParameterError(f'parameter cameras: {error}{EXPECTED}') from error

    def _start(self, namespace: str, names: Sequence[str]) -> DetectorNode | None:
        """Return the node of a camera; log why if it cannot be made, which ends no other one."""
        try:
            return DetectorNode(names, namespace=namespace, cli_args=node_arguments(sys.argv),
                                use_global_arguments=False)
        except (ParameterError, ParameterException, RuntimeError) as error:
            if not self.context.ok():
                raise
            self.get_logger().error(f'{namespace}/detector cannot be started: {error}'
                                    f'{origin(str(error), sys.argv)}')
            return None

    def _follow(self, node: DetectorNode) -> None:
        """Run the node of a camera in this thread; an exception of its callbacks ends it alone."""
        name = node.get_fully_qualified_name()
        try:
            node.run()
        except ExternalShutdownException:
            pass
        except Exception:
            if self.context.ok():
                self.get_logger().error(f'{name} has ended; the other cameras go on:\n'
                                        f'{traceback.format_exc()}')


def node_arguments(arguments: Sequence[str]) -> list[str]:
    """
    Return the arguments of a command line for a node of a camera.

    Rules for the name or the namespace of all nodes, which launch adds for one node of a process,
    are left out, because they would give all cameras the same; so is the parameter ``cameras``.
    """
    kept: list[str] = []
    begin = list(arguments).index('--ros-args') if '--ros-args' in arguments else len(arguments)
    for argument in arguments[begin:]:
        if NOT_FOR_CAMERAS.match(argument) and kept[-1].startswith('-'):
            kept.pop()
        else:
            kept.append(argument)
    return kept


def _namespaces(cameras: Sequence[str], base: str) -> list[str]:
    """Return the full namespaces of cameras; ParameterError if they cannot be used."""
    if not cameras:
        raise ParameterError(f'parameter cameras is not given or empty{EXPECTED}')
    namespaces = [camera if camera.startswith('/') else f'{base.rstrip("/")}/{camera}'
                  for camera in cameras]
    for camera, namespace in zip(cameras, namespaces):
        if namespaces.count(namespace) > 1:
            raise ParameterError(f'parameter cameras contains {camera!r} more than once')
        try:
            validate_namespace(namespace)
        except NameValidationException as error:
            raise ParameterError(f'parameter cameras contains {camera!r}: '
                                 f'{str(error).splitlines()[0]}') from error
    return namespaces


def main() -> int:
    """Run the nodes until SIGINT or SIGTERM; return the exit code."""
    return run('detectors', DetectorsNode)
