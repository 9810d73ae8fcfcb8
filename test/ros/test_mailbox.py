"""The newest item wins, and the one who puts it in knows what it replaced."""
from __future__ import annotations

from threading import Thread

from qflsd_ros.ros.mailbox import Mailbox


def test_the_newest_replaces_what_nobody_took() -> None:
    mailbox: Mailbox[int] = Mailbox()
    assert not mailbox.put(1)
    assert mailbox.put(2)
    assert next(iter(mailbox)) == 2
    assert not mailbox.put(3)


def test_close_ends_the_iteration_of_another_thread() -> None:
    mailbox: Mailbox[int] = Mailbox()
    taken: list[int] = []
    thread = Thread(target=lambda: taken.extend(mailbox), daemon=True)
    thread.start()
    mailbox.put(1)
    mailbox.close()
    thread.join(10)
    assert not thread.is_alive()
    assert taken in ([], [1])
