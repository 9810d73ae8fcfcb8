"""Subscriptions that exist only while their messages are needed."""
from __future__ import annotations

from abc import ABC, abstractmethod

from rclpy.node import Node
from rclpy.subscription import Subscription


class LazySubscription(ABC):
    """
    A subscription that exists only while somebody needs its messages.

    The constructor subscribes at once, for a moment, because a QoS override that cannot be used
    must end the node at its start and not in operation.
    """

    def __init__(self, node: Node) -> None:
        """Subscribe; a subclass sets the attributes that its :meth:`_subscribe` uses before."""
        self._node = node
        self._subscription: Subscription | None = self._subscribe()

    def __bool__(self) -> bool:
        """Return whether the subscription exists."""
        return self._subscription is not None

    def follow(self, wanted: bool) -> None:
        """Subscribe or unsubscribe, so that the subscription exists just if it is wanted."""
        if wanted and self._subscription is None:
            self._subscription = self._subscribe()
        elif not wanted and self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    @abstractmethod
    def _subscribe(self) -> Subscription:
        """Return a new subscription of the node."""
