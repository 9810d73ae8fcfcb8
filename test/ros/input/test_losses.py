"""Missing frames are distinguished from frames of another publisher."""
from __future__ import annotations

from qflsd_ros.ros.input.losses import Losses

A, B = b'a', b'b'


class Topic:
    """A topic whose publishers the test chooses."""

    def __init__(self, *publishers: bytes) -> None:
        self.publishers = frozenset(publishers)
        self.losses = Losses(lambda: self.publishers)

    def of(self, *numbers: int | None) -> int:
        """Return how many frames are missing, by the numbers of those that come."""
        return sum(self.losses.missing(number) for number in numbers)

    def change(self, *publishers: bytes, told: bool) -> None:
        """Let others publish; the middleware may tell at once, or later."""
        self.publishers = frozenset(publishers)
        if told:
            self.losses.restart()


def test_gaps_of_one_publisher_count() -> None:
    topic = Topic(A)
    assert topic.of(7, 8, 9) == 0
    assert topic.of(11) == 1
    assert topic.of(12, 112) == 99
    # One that begins anew under its old name is no gap.
    assert topic.of(1, 2) == 0
    assert topic.of(4) == 1


def test_another_publisher_is_no_gap() -> None:
    for told in (True, False):
        topic = Topic(A)
        assert topic.of(1, 2, 3) == 0
        topic.change(B, told=told)
        assert topic.of(51) == 0
        assert topic.of(52, 54) == 1
        topic.change(A, B, told=told)
        assert topic.of(55, 90, 57, 93) == 0
        topic.change(A, told=True)
        assert topic.of(200) == 0
        assert topic.of(203) == 2


def test_a_first_publisher_that_is_known_late() -> None:
    topic = Topic()
    topic.change(A, told=False)
    assert topic.of(5, 8) == 0
    assert topic.of(10) == 1


def test_what_the_middleware_reports_counts_where_numbers_say_nothing() -> None:
    topic = Topic(A)
    assert topic.losses.reported(2) == 2   # no frame has come yet
    topic.of(1, 2)
    assert topic.losses.reported(2) == 0   # the next frame's number will show them
    topic.of(None)
    assert topic.losses.reported(2) == 2   # a middleware that does not number
    topic.change(A, B, told=True)
    topic.of(3, 70)
    assert topic.losses.reported(2) == 2   # two that number each on its own
