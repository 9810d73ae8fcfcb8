"""A subscription that comes and goes."""
from __future__ import annotations

from typing import Callable

from rclpy.node import Node
from rclpy.subscription import Subscription


class LazySubscription:
    """
    A subscription that is there just as long as it is wanted.

    It is made at once, if only for a moment: that finds a bad QoS override now and not in
    mid-flight.
    """

    def __init__(self, node: Node, subscribe: Callable[[], Subscription]) -> None:
        """Take the node and what makes the subscription."""
        self._node, self._subscribe = node, subscribe
        self._subscription: Subscription | None = subscribe()

    def __bool__(self) -> bool:
        """Tell whether it is there."""
        return self._subscription is not None

    def follow(self, wanted: bool) -> None:
        """Be there, or not."""
        if wanted and self._subscription is None:
            self._subscription = self._subscribe()
        elif not wanted and self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None
