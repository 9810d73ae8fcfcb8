"""The detector's subscriptions to its camera: images, and the camera_info beside them."""
from __future__ import annotations

import time
from typing import Any, Callable, NamedTuple

from qflsd_ros.ros.input.lazy import LazySubscription
from qflsd_ros.ros.input.losses import Losses
from qflsd_ros.ros.input.transports import Transport
from rclpy.event_handler import QoSMessageLostInfo, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

# Best effort matches cameras of either reliability; depth 1, since only the newest frame counts.
QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class Frame(NamedTuple):
    """An image message and the time of its arrival, ``time.monotonic()`` in s."""

    message: Image | CompressedImage
    arrival: float


class ImageSubscription(LazySubscription):
    """
    Receives images, and counts those that were lost on their way.

    Attributes
    ----------
    topic
        Full name of the topic, after remapping and with the suffix of the transport.

    """

    def __init__(self, node: Node, transport: Transport, receive: Callable[[Frame], None],
                 lost: Callable[[int], None]) -> None:
        """
        Subscribe to the topic ``image``.

        ``receive`` is called with every frame, ``lost`` with the number of frames that the
        middleware lost before it.
        """
        # The suffix follows the remapped name, as in image_transport.
        self.topic = node.resolve_topic_name('image') + transport.suffix
        self._message_type, self._receive, self._lost = transport.message_type, receive, lost
        self._losses = Losses(lambda: frozenset(
            bytes(camera.endpoint_gid) for camera
            in node.get_publishers_info_by_topic(self.topic)))
        super().__init__(node)

    def _subscribe(self) -> Subscription:
        self._losses.restart()
        return self._node.create_subscription(
            self._message_type, self.topic, self._take, QOS,
            event_callbacks=SubscriptionEventCallbacks(
                message_lost=self._report, matched=lambda _: self._losses.restart()),
            qos_overriding_options=QoSOverridingOptions.with_default_policies())

    def _take(self, message: Image | CompressedImage, info: dict[str, Any]) -> None:
        arrival = time.monotonic()
        self._lost(self._losses.missing(info.get('publication_sequence_number')))
        self._receive(Frame(message, arrival))

    def _report(self, event: QoSMessageLostInfo) -> None:
        self._lost(self._losses.reported(event.total_count_change))


class CalibrationSubscription(LazySubscription):
    """
    Receives the camera_info beside the images.

    Attributes
    ----------
    topic
        Full name of the topic.
    newest
        The newest message; None before the first one, and while nobody needs it.

    """

    def __init__(self, node: Node) -> None:
        """Subscribe to ``camera_info`` in the namespace of the remapped topic ``image``."""
        self.topic = calibration_topic(node.resolve_topic_name('image'))
        self.newest: CameraInfo | None = None
        super().__init__(node)

    def follow(self, wanted: bool) -> None:
        """Subscribe or unsubscribe; the camera may be another one by the time of the next use."""
        super().follow(wanted)
        if not wanted:
            self.newest = None

    def _subscribe(self) -> Subscription:
        return self._node.create_subscription(
            CameraInfo, self.topic, self._take, QOS,
            qos_overriding_options=QoSOverridingOptions.with_default_policies())

    def _take(self, message: CameraInfo) -> None:
        self.newest = message


def calibration_topic(image_topic: str) -> str:
    """Return the topic of the camera_info that belongs to an image topic, by ROS's convention."""
    return image_topic.rpartition('/')[0] + '/camera_info'
