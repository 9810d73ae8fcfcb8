"""
What each stage of the detector costs.

Stages are found, not listed: from :meth:`Detector.detect` on, every function of the core and of
OpenCV that is called from Python, as the source says.  Each is replaced by one that notes the
time, for as long as the measurement takes.
"""
from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack
import inspect
import textwrap
import time
from types import FunctionType, ModuleType
from typing import Any
from unittest import mock

from benchmark.experiment import Experiment
from benchmark.peers import load, OURS
from benchmark.report import number, section, table
import cv2
import numpy as np
from qflsd_ros.core import Detector
from tqdm import tqdm

CORE = 'qflsd_ros.core'
TOTAL, OUTPUT = 'all', 'Arcs.polylines'
Place = tuple[ModuleType, str]          # where a function is looked up when it is called


def places(function: Callable[..., Any]) -> list[Place]:
    """Return where the functions that a Python function calls are looked up, and those below."""
    found: list[Place] = []
    waiting = [function]
    while waiting:
        for place in _called(waiting.pop(0)):
            if place not in found:
                found.append(place)
                called = getattr(*place)
                if isinstance(called, FunctionType):
                    waiting.append(called)
    return found


def _called(function: Callable[..., Any]) -> Iterator[Place]:
    """Return the calls in a function's, or in a class's, own source."""
    home = inspect.getmodule(function)
    for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(function)))):
        if not isinstance(node, ast.Call):
            continue
        place = None
        if isinstance(node.func, ast.Name):
            place = home, node.func.id
        elif isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name):
            place = vars(home).get(node.func.value.id), node.func.attr
        if place is not None and _is_stage(*place):
            yield place


def _is_stage(module: Any, name: str) -> bool:
    if not isinstance(module, ModuleType):
        return False
    called = getattr(module, name, None)
    owner = getattr(called, '__module__', None) or ''
    return callable(called) and not inspect.isclass(called) and (
        module is cv2 or owner.startswith(CORE))


class Clock:
    """CPU time of functions, without that of the functions that they call."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._inner = [0.0]

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that does the same and is timed under a name."""
        def run(*arguments: Any, **options: Any) -> Any:
            self._inner.append(0.0)
            start = time.process_time()
            try:
                return function(*arguments, **options)
            finally:
                elapsed = time.process_time() - start
                self.seconds[name] += elapsed - self._inner.pop()
                self._inner[-1] += elapsed
        return run


def costs(gray: np.ndarray, rounds: int) -> dict[str, float]:
    """Return the median CPU time in ms of every stage on one image, and of all together."""
    peer = load(OURS)
    peer(gray)
    samples = defaultdict(list)
    for _ in range(rounds):
        clock = Clock()
        with ExitStack() as stack:
            for module, name in places(Detector):
                function = getattr(module, name)
                home = module.__name__.rpartition('.')[2]
                stack.enter_context(mock.patch.object(
                    module, name, clock.timed(f'{home}.{name}', function)))
            arcs = clock.timed('rest of Detector.detect', peer.detect)(gray)
            clock.timed(OUTPUT, peer.polylines)(arcs)
        for name, seconds in clock.seconds.items():
            samples[name].append(1e3 * seconds)
        samples[TOTAL].append(1e3 * sum(clock.seconds.values()))
    return {name: float(np.median(values)) for name, values in samples.items()}


def measure(experiment: Experiment) -> str:
    """Write the section."""
    views = [view for lens in ('regular', 'fisheye')
             for view in experiment.dataset.of_lens(lens, experiment.effort.per_lens)]
    results = [costs(view.gray, experiment.effort.rounds) for view in tqdm(views, 'stages')]
    names = dict.fromkeys(name for result in results for name in result)
    means = {name: float(np.mean([result.get(name, 0.0) for result in results]))
             for name in names}
    order = sorted(means, key=lambda name: (name == TOTAL, -means[name]))
    rows = [(f'`{name}`' if name != TOTAL else name, number(means[name]),
             number(100 * means[name] / means[TOTAL], 1)) for name in order]
    return section(
        'Cost of each stage', f'Mean over {len(views)} images of the median CPU time, each '
        'without the functions below it; the clock itself adds a little to each.',
        table(('function', 'ms', '%'), rows))
