"""A binary heap in given memory: the cheapest item first."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled

ITEM = 4        # numbers of an item


class Heap(NamedTuple):
    """Up to K items, the cheapest at row 0, and each of row i below those of 2 i + 1 and + 2."""

    costs: np.ndarray       # (K,) float64
    items: np.ndarray       # (K, ITEM) int64
    size: np.ndarray        # (1,) int64, the number of items


@compiled
def _is_before(heap: Heap, i: int, j: int) -> bool:
    """Return whether item i comes before item j: by its cost, then by its first numbers."""
    if heap.costs[i] != heap.costs[j]:
        return bool(heap.costs[i] < heap.costs[j])
    for k in range(ITEM):
        if heap.items[i, k] != heap.items[j, k]:
            return bool(heap.items[i, k] < heap.items[j, k])
    return False


@compiled
def _swap(heap: Heap, i: int, j: int) -> None:
    heap.costs[i], heap.costs[j] = heap.costs[j], heap.costs[i]
    for k in range(ITEM):
        heap.items[i, k], heap.items[j, k] = heap.items[j, k], heap.items[i, k]


@compiled
def push(heap: Heap, cost: float, item: tuple[int, int, int, int]) -> None:
    """Add an item; there must be room for it."""
    i = heap.size[0]
    heap.costs[i] = cost
    heap.items[i, 0], heap.items[i, 1], heap.items[i, 2], heap.items[i, 3] = item
    heap.size[0] = i + 1
    while i > 0 and _is_before(heap, i, (i - 1) // 2):
        _swap(heap, i, (i - 1) // 2)
        i = (i - 1) // 2


@compiled
def pop(heap: Heap) -> tuple[int, int, int, int]:
    """Remove the cheapest item, of at least one, and return it."""
    item = (heap.items[0, 0], heap.items[0, 1], heap.items[0, 2], heap.items[0, 3])
    last = heap.size[0] - 1
    _swap(heap, 0, last)
    heap.size[0] = last
    i = 0
    while 2 * i + 1 < last:
        child = 2 * i + 1
        if child + 1 < last and _is_before(heap, child + 1, child):
            child += 1
        if not _is_before(heap, child, i):
            break
        _swap(heap, i, child)
        i = child
    return item
