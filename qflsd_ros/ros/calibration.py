"""CameraInfo as the lens of the images that come with it."""
from __future__ import annotations

import numpy as np
from qflsd_ros.core.lens import Lens
from qflsd_ros.ros.errors import FrameError
from sensor_msgs.msg import CameraInfo


class CalibrationError(FrameError):
    """A CameraInfo that is missing, or of no use for an image."""


def lens(info: CameraInfo | None, topic: str, height: int, width: int) -> Lens:
    """
    Return the lens through which an image was taken.

    Parameters
    ----------
    info
        The newest CameraInfo, or None while none has come.
    topic
        Where it comes from, for what there is to say of it.
    height, width
        Size of the image, px.

    Raises
    ------
    CalibrationError
        There is none, it is of images of another size, or its model is unknown.

    """
    if info is None:
        raise CalibrationError('no camera_info', f'no camera_info has come on {topic}: '
                               'there are no planes without it')
    if (info.width, info.height) != (width, height):
        raise CalibrationError(
            'camera_info of another size', f'camera_info on {topic} is of images of {info.width} '
            f'x {info.height} pixels: must be of {width} x {height}, as the image')
    try:
        return Lens(info.distortion_model, np.reshape(info.k, (3, 3)), np.array(info.d))
    except ValueError as error:
        raise CalibrationError('camera_info of no use', f'camera_info on {topic}: {error}') \
            from error


def topic_of(image_topic: str) -> str:
    """Return where the CameraInfo of an image topic is: beside it."""
    return image_topic.rpartition('/')[0] + '/camera_info'
