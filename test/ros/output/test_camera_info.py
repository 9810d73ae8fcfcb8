"""A CameraInfo with region and binning gives a camera for the pixels of the image."""
from __future__ import annotations

import numpy as np
import pytest
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.ros.output import camera_info
from qflsd_ros.ros.output.camera_info import CalibrationError
from sensor_msgs.msg import CameraInfo, RegionOfInterest
from std_msgs.msg import Header

K = [400.0, 3.0, 321.0, 0.0, 410.0, 239.0, 0.0, 0.0, 1.0]
D = [-0.2, 0.05, 0.001, -0.002, 0.0]


def info(binning: tuple[int, int] = (0, 0), region: tuple[int, int, int, int] = (0, 0, 0, 0)
         ) -> CameraInfo:
    x, y, width, height = region
    return CameraInfo(
        width=640, height=480, distortion_model='plumb_bob', k=K, d=D,
        binning_x=binning[0], binning_y=binning[1],
        roi=RegionOfInterest(x_offset=x, y_offset=y, width=width, height=height))


@pytest.mark.parametrize('binning', [(0, 0), (1, 1), (2, 2), (4, 1)])
@pytest.mark.parametrize('region', [(0, 0, 0, 0), (80, 40, 400, 240), (7, 5, 633, 475)])
def test_a_pixel_looks_where_its_rectangle_looks(binning: tuple[int, int],
                                                 region: tuple[int, int, int, int]) -> None:
    """The ray of a binned pixel is that of the centre of its sensor pixels."""
    columns, rows = max(1, binning[0]), max(1, binning[1])
    x, y, width, height = region
    size = ((width or 640) // columns, (height or 480) // rows)
    lens = camera_info.camera_model(info(binning, region), '/camera_info', size[1], size[0])
    whole = camera_info.camera_model(info(), '/camera_info', 480, 640)
    pixels = np.array([[0, 0], [30, 40], [size[0] - 1, size[1] - 1]], float)
    first = (x, y) + pixels * (columns, rows)
    last = first + (columns - 1, rows - 1)
    assert lens.rays(pixels) == pytest.approx(whole.rays((first + last) / 2), abs=1e-12)


@pytest.mark.parametrize('binning, region, wanted', [
    ((2, 2), (0, 0, 0, 0), '320 x 240'), ((0, 0), (0, 0, 100, 50), '100 x 50'),
    ((2, 4), (8, 8, 100, 50), '50 x 12'), ((10**6, 1), (0, 0, 0, 0), '0 x 480')])
def test_images_of_another_size_are_named(binning: tuple[int, int],
                                          region: tuple[int, int, int, int], wanted: str) -> None:
    with pytest.raises(CalibrationError, match=f'describes images of {wanted} pixels: '
                       'must describe images of 640 x 480') as caught:
        camera_info.camera_model(info(binning, region), '/camera_info', 480, 640)
    assert caught.value.reason == 'camera_info of another size'


@pytest.mark.parametrize('model, given, wanted', [
    ('plumb_bob', [-0.2], [-0.2, 0, 0, 0, 0]), ('equidistant', [0.1, 0.2], [0.1, 0.2, 0, 0]),
    ('rational_polynomial', [0.1] * 6, [0.1] * 6 + [0, 0]),
    ('rational_polynomial', [0.1] * 9, [0.1] * 9 + [0, 0, 0])])
def test_a_calibrated_camera_comes_back(model: str, given: list[float],
                                        wanted: list[float]) -> None:
    camera = CameraModel(model, np.reshape(K, (3, 3)), np.array(given))
    info = camera_info.calibrated(Header(frame_id='eye'), camera, 480, 640)
    assert info.d.tolist() == wanted and info.header.frame_id == 'eye'
    assert info.r.tolist() == np.eye(3).ravel().tolist()
    back = camera_info.camera_model(info, '/camera_info', 480, 640)
    assert back.model == model and (back.matrix == camera.matrix).all()
    assert (back.coefficients == camera.coefficients).all()
