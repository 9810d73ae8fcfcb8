"""
CPU time of detectors, side by side.

All detectors run in turn in one process, round after round: a slow phase of the machine slows all
of them alike.  The figure is the median of the CPU time of the process.  The first round does not
count, except for a detector that takes longer than 0.2 s, which runs only once.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import time
from typing import Any, TypeVar

from benchmark.peers import load
import numpy as np
from tqdm import tqdm

SLOW = 0.2      # s, of a single run
Result = TypeVar('Result')


@dataclass(frozen=True)
class Timing:
    """Median CPU time in ms, and the number of lines or arcs found."""

    ms: float
    count: int


Timings = dict[str, dict[str, Timing]]      # by image, by detector


def measure(images: Mapping[str, np.ndarray], names: Sequence[str], rounds: int,
            title: str) -> Timings:
    """Time every detector on every image, (H, W) uint8."""
    return {image: _measure_one(gray, names, rounds)
            for image, gray in tqdm(images.items(), title)}


def _measure_one(gray: np.ndarray, names: Sequence[str], rounds: int) -> dict[str, Timing]:
    times: dict[str, list[float]] = {}
    counts = {}
    for name in names:
        peer = load(name)
        seconds, found = run(peer.detect, gray)
        times[name], counts[name] = [seconds], len(peer.polylines(found))
    quick = [name for name in names if times[name][0] < SLOW]
    for name in quick:
        times[name].clear()
    for _ in range(rounds):
        for name in quick:
            times[name].append(run(load(name).detect, gray)[0])
    return {name: Timing(1e3 * float(np.median(times[name])), counts[name]) for name in names}


def run(function: Callable[..., Result], *arguments: Any) -> tuple[float, Result]:
    """Return the CPU time in s that a call takes, and its result."""
    start = time.process_time()
    result = function(*arguments)
    return time.process_time() - start, result


def ratio(timings: Timings, name: str, to: str) -> float:
    """Return the time of a detector over that of ``to``: geometric mean over images."""
    return float(np.exp(np.mean([np.log(row[name].ms / row[to].ms) for row in timings.values()])))
