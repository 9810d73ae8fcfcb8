"""CameraInfo as the lens of the images that come with it, and the other way round."""
from __future__ import annotations

from array import array

import numpy as np
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.ros.lens import described
from qflsd_ros.sources.frames import FrameError
from qflsd_ros.sources.reasons import Reason
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header


class CalibrationError(FrameError):
    """A CameraInfo that is missing, or of no use for an image."""


def lens(info: CameraInfo | None, topic: str, height: int, width: int) -> CameraModel:
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
        raise CalibrationError(Reason.NO_CALIBRATION, f'no camera_info has come on {topic}: '
                               'there are no planes without it')
    if size(info) != (width, height):
        raise CalibrationError(
            Reason.OTHER_CALIBRATION, f'camera_info on {topic} is of images of '
            f'{" x ".join(map(str, size(info)))} pixels: must be of {width} x {height}, as the '
            'image')
    try:
        return CameraModel(info.distortion_model, matrix(info), np.array(info.d))
    except ValueError as error:
        raise CalibrationError(Reason.BAD_CALIBRATION, f'camera_info on {topic}: {error}') \
            from error


def size(info: CameraInfo) -> tuple[int, int]:
    """Return width and height, px, of the images of a camera: of its region, after binning."""
    columns, rows = binning(info)
    region = info.roi
    return ((region.width or info.width) // columns, (region.height or info.height) // rows)


def matrix(info: CameraInfo) -> np.ndarray:
    """
    Return the matrix K, (3, 3) float64, for the pixels of the images.

    What CameraInfo holds is for the whole image without binning.  A binned pixel combines a
    rectangle of pixels, and its coordinates are those of the rectangle's centre.
    """
    result = np.reshape(info.k, (3, 3)).astype(float)
    offset = info.roi.x_offset, info.roi.y_offset
    for axis, (first, pixels) in enumerate(zip(offset, binning(info))):
        result[axis, 2] -= first + (pixels - 1) / 2
        result[axis] /= pixels
    return result


def binning(info: CameraInfo) -> tuple[int, int]:
    """Return how many columns and rows make a pixel; 0 in the message stands for 1."""
    return info.binning_x or 1, info.binning_y or 1


def topic_of(image_topic: str) -> str:
    """Return where the CameraInfo of an image topic is: beside it."""
    return image_topic.rpartition('/')[0] + '/camera_info'


def camera_info(header: Header, model: DivisionModel, focal_length: float) -> CameraInfo:
    """
    Return a lens such that nodes that rectify images straighten those with this header.

    The rectified image has the scale of the raw one at the centre of distortion.
    """
    found = described(model, focal_length)
    height, width = model.shape
    projection = np.concatenate([found.matrix, np.zeros((3, 1))], axis=1)
    return CameraInfo(
        header=header, height=height, width=width, distortion_model=found.distortion_model,
        d=array('d', found.coefficients), k=found.matrix.ravel(), r=np.eye(3).ravel(),
        p=projection.ravel())
