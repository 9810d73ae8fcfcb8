"""CameraInfo's models instead of the division model: what OpenCV makes of them is the same."""
from __future__ import annotations

import cv2
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core import DivisionModel
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.conversion import (
    calibration_terms, camera_info_terms, CameraInfoTerms, CLOSE, natural_focal_length)

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
    found = camera_info_terms(lens)
    assert found.residual < CLOSE[found.distortion_model]
    assert len(found.coefficients) == {'rational_polynomial': 8,
                                       'equidistant': 4}[found.distortion_model]
    rays = CameraModel(found.distortion_model, found.matrix, found.coefficients).rays(grid())
    offset = (grid() - lens.origin) / lens.half_diagonal
    depth = found.matrix[0, 0] / lens.half_diagonal * (1 + lam * (offset ** 2).sum(1))
    wanted = np.concatenate([offset, depth[:, None]], 1)
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    # An angle that the residual subtends.
    assert np.abs(rays - wanted).max() < 1e-6 + 4 * found.residual / found.matrix[0, 0]


def difference(found: CameraInfoTerms, lens: DivisionModel) -> float:
    """Return by how much OpenCV's rectification differs from the division model, px."""
    rectify = (cv2.fisheye.initUndistortRectifyMap if found.distortion_model == 'equidistant'
               else cv2.initUndistortRectifyMap)
    maps = rectify(found.matrix, found.coefficients, np.eye(3), found.matrix, (640, 480),
                   cv2.CV_32FC1)
    y, x = np.mgrid[:480, :640]
    wanted = lens.distort(np.stack([x, y], -1).astype(float))
    shown = (wanted > 0).all(axis=-1) & (wanted < (639, 479)).all(axis=-1)
    return float(np.abs(np.stack(maps, -1) - wanted)[shown].max())


@given(lambdas, shifts)
def test_what_opencv_rectifies_by_it_is_what_the_division_model_undistorts(lam, shift):
    lens = lens_of(lam, shift)
    found = camera_info_terms(lens)
    assert difference(found, lens) < found.residual + 0.01


@pytest.mark.parametrize('lam, model', [
    (0.3, 'rational_polynomial'), (0.0, 'rational_polynomial'), (-0.4, 'rational_polynomial'),
    (-1.5, 'equidistant'), (-3.0, 'equidistant')])
def test_which_model(lam, model):
    assert camera_info_terms(DivisionModel(lam, SHAPE)).distortion_model == model


@pytest.mark.parametrize('focal_length', [80.0, 150.0, 250.0, 400.0, 700.0, 1500.0])
@pytest.mark.parametrize('lam', [-5.0, -2.0, -0.9, -0.6, -0.3, 0.0, 0.3])
def test_the_focal_length_does_not_change_what_is_straightened(lam, focal_length):
    lens = DivisionModel(lam, SHAPE, (330.0, 230.0))
    found = camera_info_terms(lens, focal_length)
    assert found.matrix.tolist() == [[focal_length, 0, 330], [0, focal_length, 230], [0, 0, 1]]
    assert difference(found, lens) < found.residual + 0.01 < 0.21


def projected(found: CameraInfoTerms, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return how far from the centre it shows directions (x, 0, z), px."""
    if found.distortion_model == 'equidistant':
        angle = np.arctan2(x, z)
        powers = angle[:, None] ** [2, 4, 6, 8]
        return found.matrix[0, 0] * angle * (1 + powers @ found.coefficients)
    rays = np.stack([x / z, 0 * x, 1 + 0 * x], axis=1)
    pixels, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), found.matrix,
                                  found.coefficients)
    return pixels[:, 0, 0] - found.matrix[0, 2]


@pytest.mark.parametrize('lam', [-8.0, -5.0, -2.0, -0.9, -0.3, 0.3, 0.6])
@pytest.mark.parametrize('focal_length', [0.0, 80.0, 250.0, 700.0])
def test_it_is_the_same_lens_up_to_the_stated_radius(lam, focal_length):
    lens = lens_of(lam, (20.0, -10.0))
    found = camera_info_terms(lens, focal_length)
    radii = np.linspace(0, found.radius, 1000)[1:]
    r = radii / lens.half_diagonal
    shown = projected(found, r, found.matrix[0, 0] / lens.half_diagonal * (1 + lam * r ** 2))
    assert np.abs(shown - radii).max() < 1.1 * found.residual + 1e-6 < 0.25
    # That is as far as a rectified image goes at least.
    corners = np.array([[0.0, 0], [639, 0], [0, 479], [639, 479]])
    corners = lens.distort(corners) - lens.origin
    assert found.radius > np.nanmax(np.hypot(*corners.T), initial=0)


@pytest.mark.parametrize('lam, focal_length, model, whole', [
    (-0.8, 0.0, 'equidistant', True), (-0.7, 1000.0, 'rational_polynomial', True),
    (-0.9, 400.0, 'rational_polynomial', False), (-2.0, 400.0, 'rational_polynomial', False),
    (-5.0, 0.0, 'equidistant', True)])
def test_a_fisheye_is_described_in_full_where_its_focal_length_lets_it(lam, focal_length, model,
                                                                       whole):
    found = camera_info_terms(DivisionModel(lam, SHAPE), focal_length)
    assert found.distortion_model == model
    assert (found.radius > 399) == whole


def test_a_focal_length_of_a_fisheye():
    assert natural_focal_length(DivisionModel(0.0, (600, 800))) == 500
    assert natural_focal_length(DivisionModel(-1.0, (600, 800))) == 250


@pytest.mark.parametrize('lam', [-0.75, -0.5, -0.2, 0.0, 0.1, 0.3, 0.5])
@pytest.mark.parametrize('focal', [200.0, 360.0, 800.0])
def test_calibration_holds_all_over_the_image(lam: float, focal: float) -> None:
    """Also for a pincushion whose corners lie where the undistorted image is steep."""
    lens = DivisionModel(lam, SHAPE)
    found = calibration_terms(lens, focal)
    assert found.matrix.tolist() == [[focal, 0, 319.5], [0, focal, 239.5], [0, 0, 1]]
    assert found.radius == pytest.approx(np.hypot(319.5, 239.5))
    rays = CameraModel(found.distortion_model, found.matrix, found.coefficients).rays(grid())
    side, depth = rays[:, :2], rays[:, 2:] * lens.half_diagonal / focal
    root = np.sqrt(depth ** 2 - 4 * lam * (side ** 2).sum(1, keepdims=True))
    imaged = 2 * side / (depth + root) * lens.half_diagonal + lens.origin
    assert np.abs(imaged - grid()).max() < found.residual + 1e-4 < 0.1


def test_calibration_of_a_fisheye_reaches_beyond_90_degrees() -> None:
    lens = DivisionModel(-1.3, SHAPE)
    found = calibration_terms(lens, natural_focal_length(lens))
    assert found.distortion_model == 'equidistant' and found.residual < 0.1
