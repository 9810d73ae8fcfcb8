"""The transports of image messages, raw and compressed: one row each."""
from __future__ import annotations

from typing import Callable, NamedTuple

import numpy as np
from qflsd_ros.ros.input import compressed, images
from sensor_msgs.msg import CompressedImage, Image


class Transport(NamedTuple):
    """
    One way in which images reach the node.

    Attributes
    ----------
    message_type
        Type of the messages.
    suffix
        Text that follows the name of the image topic, as in image_transport.
    read
        Converts a message, a white level and a limit of pixels into a grey frame, (H, W) uint8.

    """

    message_type: type
    suffix: str
    read: Callable[..., np.ndarray]


# By the value of the parameter image_transport.
TRANSPORTS = {
    'raw': Transport(Image, '', images.read),
    'compressed': Transport(CompressedImage, '/compressed', compressed.decode),
}
