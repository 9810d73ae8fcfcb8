"""CameraInfo's models instead of the division model: what OpenCV makes of them is the same."""
from __future__ import annotations

import cv2
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core import DivisionModel
from qflsd_ros.core.calibration import calibration, natural_focal_length
from qflsd_ros.core.lens import Lens

SHAPE = (480, 640)
lambdas = st.floats(-3, 0.24)
shifts = st.tuples(st.floats(-30, 30), st.floats(-30, 30))


def lens_of(lam: float, shift: tuple[float, float]) -> DivisionModel:
    return DivisionModel(lam, SHAPE, (319.5 + shift[0], 239.5 + shift[1]))


def grid() -> np.ndarray:
    """Return points all over the image, (N, 2) px."""
    x, y = np.meshgrid(np.arange(0, 640, 20.0), np.arange(0, 480, 20.0))
    return np.stack([x.ravel(), y.ravel()], axis=1)


@given(lambdas, shifts)
def test_it_is_the_same_lens_all_over_the_image(lam, shift):
    lens = lens_of(lam, shift)
    found = calibration(lens)
    assert found.residual < 0.05
    assert len(found.coefficients) == {'rational_polynomial': 8,
                                       'equidistant': 4}[found.distortion_model]
    rays = Lens(found.distortion_model, found.matrix, found.coefficients).rays(grid())
    offset = (grid() - lens.origin) / lens.half_diagonal
    depth = found.matrix[0, 0] / lens.half_diagonal * (1 + lam * (offset ** 2).sum(1))
    wanted = np.concatenate([offset, depth[:, None]], 1)
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    # An angle that the residual subtends.
    assert np.abs(rays - wanted).max() < 1e-6 + 4 * found.residual / found.matrix[0, 0]


@given(lambdas, shifts)
def test_what_opencv_rectifies_by_it_is_what_the_division_model_undistorts(lam, shift):
    lens = lens_of(lam, shift)
    found = calibration(lens)
    rectify = (cv2.fisheye.initUndistortRectifyMap if found.distortion_model == 'equidistant'
               else cv2.initUndistortRectifyMap)
    maps = rectify(found.matrix, found.coefficients, np.eye(3), found.matrix, (640, 480),
                   cv2.CV_32FC1)
    y, x = np.mgrid[:480, :640]
    wanted = lens.distort(np.stack([x, y], -1).astype(float))
    shown = (wanted > 0).all(axis=-1) & (wanted < (639, 479)).all(axis=-1)
    assert np.abs(np.stack(maps, -1) - wanted)[shown].max() < found.residual + 0.01


@pytest.mark.parametrize('lam, model', [
    (0.3, 'rational_polynomial'), (0.0, 'rational_polynomial'), (-0.4, 'rational_polynomial'),
    (-1.5, 'equidistant'), (-3.0, 'equidistant')])
def test_which_model(lam, model):
    assert calibration(DivisionModel(lam, SHAPE)).distortion_model == model


def test_the_focal_length_does_not_change_what_is_straightened():
    lens = DivisionModel(-0.3, SHAPE)
    undistorted = lens.undistort(grid())
    for focal_length in (200.0, 400.0, 1000.0):
        found = calibration(lens, focal_length)
        assert found.matrix.tolist() == [[focal_length, 0, 319.5], [0, focal_length, 239.5],
                                         [0, 0, 1]]
        rays = np.concatenate([(undistorted - lens.origin) / focal_length,
                               np.ones((len(undistorted), 1))], 1)
        seen, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), found.matrix,
                                    found.coefficients)
        assert seen.reshape(-1, 2) == pytest.approx(grid(), abs=0.01)


def test_a_focal_length_of_a_fisheye():
    assert natural_focal_length(DivisionModel(0.0, (600, 800))) == 500
    assert natural_focal_length(DivisionModel(-1.0, (600, 800))) == 250
