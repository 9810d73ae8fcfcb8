"""The newest item replaces a waiting one, and its sender knows that."""
from __future__ import annotations

from threading import Thread

from qflsd_ros.ros.input.slot import Slot


def test_the_newest_replaces_what_nobody_took() -> None:
    slot: Slot[int] = Slot()
    assert not slot.put(1)
    assert slot.put(2)
    assert next(iter(slot)) == 2
    assert not slot.put(3)


def test_close_ends_the_iteration_of_another_thread() -> None:
    slot: Slot[int] = Slot()
    taken: list[int] = []
    thread = Thread(target=lambda: taken.extend(slot), daemon=True)
    thread.start()
    slot.put(1)
    slot.close()
    thread.join(10)
    assert not thread.is_alive()
    assert taken in ([], [1])
