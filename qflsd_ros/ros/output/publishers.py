"""The publishers of all outputs; a message is built only for a topic that has a subscription."""
from __future__ import annotations

import traceback
from typing import Callable

from qflsd_ros.ros.output.topics import Output, OUTPUTS, Result
from qflsd_ros.sources.frames import FrameError
from qflsd_ros.sources.reasons import Reason
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

# Reliable publishers match subscriptions of either reliability.
QOS = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE)


def advertise(node: Node, message_type: type, topic: str,
              changed: Callable[[], None] = lambda: None) -> Publisher:
    """
    Return a publisher whose quality of service parameters can override.

    ``changed`` is called whenever a subscription to the topic begins or ends.
    """
    return node.create_publisher(
        message_type, topic, QOS,
        event_callbacks=PublisherEventCallbacks(matched=lambda _: changed()),
        qos_overriding_options=QoSOverridingOptions.with_default_policies())


class Publishers:
    """One publisher for each output."""

    def __init__(self, node: Node, changed: Callable[[], None]) -> None:
        """Advertise all outputs; ``changed`` is called when a subscription begins or ends."""
        self._publishers = {output: advertise(node, output.message_type, output.topic, changed)
                            for output in OUTPUTS}

    def wanted(self) -> list[Output]:
        """Return the outputs whose topics have a subscription."""
        return [output for output, publisher in self._publishers.items()
                if publisher.get_subscription_count()]

    def publish(self, result: Result) -> dict[str, str]:
        """
        Build and publish all wanted outputs of a frame that it passes.

        An output that cannot be built does not keep back the others.  Returns the error texts of
        such outputs, by the phrase of their reason.
        """
        errors: dict[str, str] = {}
        for output in self.wanted():
            try:
                if output.passes(result):
                    self._publishers[output].publish(output.message(result))
            except FrameError as error:
                errors[error.reason] = str(error)
            except Exception:
                errors[Reason.INTERNAL.phrase] = traceback.format_exc()
        return errors
