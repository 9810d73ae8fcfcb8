"""One function over many tasks, on all cores, with a progress bar; not for measuring time."""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import multiprocessing
import os
from typing import TypeVar

from tqdm import tqdm

PRELOADED = ['benchmark.metrics', 'benchmark.peers', 'benchmark.scenes.rendered']
Task = TypeVar('Task')
Result = TypeVar('Result')


def each(function: Callable[[Task], Result], tasks: Sequence[Task],
         title: str, fresh: bool = False) -> Iterator[tuple[Task, Result]]:
    """Return every task with its result, in order; ``fresh``: each in a process of its own."""
    cores = len(os.sched_getaffinity(0))
    # Workers are forked from a server: this process may have threads of ROS by now.
    context = multiprocessing.get_context('forkserver')
    context.set_forkserver_preload(PRELOADED)
    with context.Pool(min(cores, len(tasks)), maxtasksperchild=1 if fresh else None) as pool:
        results = tqdm(pool.imap(function, tasks), title, len(tasks))
        for result, task in zip(results, tasks):
            yield task, result
