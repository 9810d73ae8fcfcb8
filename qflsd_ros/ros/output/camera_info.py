"""CameraInfo messages: read as a calibrated camera, and written from a distortion model."""
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

# Coefficients in a message, by ROS's convention.  Those of a thin prism follow as 4 more where a
# camera has them, which OpenCV accepts.
LENGTHS = {'plumb_bob': 5, 'rational_polynomial': 8, 'equidistant': 4}


class CalibrationError(FrameError):
    """A CameraInfo that is missing, or that does not describe the camera of the image."""


def camera_model(info: CameraInfo | None, topic: str, height: int, width: int) -> CameraModel:
    """
    Return the calibrated camera that took an image.

    Parameters
    ----------
    info
        The newest CameraInfo, None if none has been received.
    topic
        Name of its topic, for error messages.
    height, width
        Size of the image, px.

    Raises
    ------
    CalibrationError
        No CameraInfo has been received, it belongs to images of another size, its distortion
        model is unknown, or its numbers describe no camera.

    """
    if info is None:
        raise CalibrationError(
            Reason.NO_CALIBRATION,
            f'no camera_info has been received on {topic}: planes and line_features need one')
    if size(info) != (width, height):
        raise CalibrationError(
            Reason.OTHER_CALIBRATION,
            f'camera_info on {topic} describes images of {" x ".join(map(str, size(info)))} '
            f'pixels: must describe images of {width} x {height}, like the one received')
    try:
        return CameraModel(info.distortion_model, matrix(info), np.array(info.d))
    except ValueError as error:
        raise CalibrationError(
            Reason.BAD_CALIBRATION, f'camera_info on {topic}: {error}') from error


def size(info: CameraInfo) -> tuple[int, int]:
    """Return width and height of a camera's images, px: of its region, after binning."""
    columns, rows = binning(info)
    region = info.roi
    return ((region.width or info.width) // columns, (region.height or info.height) // rows)


def matrix(info: CameraInfo) -> np.ndarray:
    """
    Return the camera matrix K, (3, 3) float64, for the pixels of a camera's images.

    The K of the message holds for the whole sensor without binning.  A binned pixel combines a
    rectangle of sensor pixels, and its coordinates are those of the centre of the rectangle.
    """
    result = np.reshape(info.k, (3, 3)).astype(float)
    offset = info.roi.x_offset, info.roi.y_offset
    for axis, (first, pixels) in enumerate(zip(offset, binning(info))):
        result[axis, 2] -= first + (pixels - 1) / 2
        result[axis] /= pixels
    return result


def binning(info: CameraInfo) -> tuple[int, int]:
    """Return the numbers of columns and rows that form one pixel; 0 in the message means 1."""
    return info.binning_x or 1, info.binning_y or 1


def uncalibrated(header: Header, model: DivisionModel) -> CameraInfo:
    """Return the CameraInfo of a lens whose focal length is not known yet: K is 0."""
    height, width = model.shape
    return CameraInfo(header=header, height=height, width=width)


def calibrated(header: Header, camera: CameraModel, height: int, width: int) -> CameraInfo:
    """Return the CameraInfo of a calibrated camera without rotation, for images of its size."""
    length = LENGTHS[camera.model]
    coefficients = camera.coefficients if camera.coefficients[length:].any() \
        else camera.coefficients[:length]
    return _info(header, (height, width), camera.model, camera.matrix, coefficients)


def _info(header: Header, shape: tuple[int, int], model: str, matrix: np.ndarray,
          coefficients: np.ndarray) -> CameraInfo:
    """Return a CameraInfo in which K is the camera matrix of the rectified image, too."""
    projection = np.concatenate([matrix, np.zeros((3, 1))], axis=1)
    return CameraInfo(
        header=header, height=shape[0], width=shape[1], distortion_model=model,
        d=array('d', coefficients), k=matrix.ravel(), r=np.eye(3).ravel(), p=projection.ravel())


def message(header: Header, model: DivisionModel, focal_length: float) -> CameraInfo:
    """
    Return the CameraInfo with which a rectifying node straightens images of a lens.

    Parameters
    ----------
    header
        Header of the image.
    model
        Distortion model of the lens.
    focal_length
        Focal length at the centre, px; 0 selects one that is natural for the lens.

    Returns
    -------
    info
        At the centre of distortion, the rectified image has the scale of the raw one.

    """
    found = described(model, focal_length)
    return _info(header, model.shape, found.distortion_model, found.matrix, found.coefficients)
