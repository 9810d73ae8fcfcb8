"""A place for one item between two threads."""
from __future__ import annotations

from threading import Condition
from typing import Generic, Iterator, TypeVar

Item = TypeVar('Item')


class Slot(Generic[Item]):
    """
    A place for one item, in which a new item replaces one that has not been taken yet.

    Iteration takes one item after the other, waits for each, and ends when the slot is closed.
    """

    def __init__(self) -> None:
        self._items: list[Item] = []
        self._closed = False
        self._changed = Condition()

    def put(self, item: Item) -> bool:
        """Put an item in; return whether it replaced another one."""
        with self._changed:
            replaced = bool(self._items)
            self._items = [item]
            self._changed.notify()
        return replaced

    def close(self) -> None:
        """End the iteration; an item that still waits is discarded."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def __iter__(self) -> Iterator[Item]:
        """Yield each item when it arrives; items that were replaced before are left out."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._items or self._closed)
                if self._closed:
                    return
                item = self._items.pop()
            yield item
