"""Rays against OpenCV's projection, which goes the other way."""
from __future__ import annotations

import cv2
import numpy as np
import pytest
from qflsd_ros.core.lens.camera_model import CameraModel

MATRIX = np.array([[400.0, 0, 320], [0, 410, 235], [0, 0, 1]])
PINHOLES = [
    ('plumb_bob', []), ('plumb_bob', [-0.3, 0.1, 0.001, -0.002]),
    ('plumb_bob', [-0.3, 0.1, 0.001, -0.002, -0.02]),
    ('rational_polynomial', [0.5, -0.1, 0.001, 0.002, 0.01, 0.9, 0.05, 0.002]),
    ('rational_polynomial', [0.5, -0.1, 0.001, 0.002, 0.01, 0.9, 0.05, 0.002, 1e-3, 2e-3, 1e-3,
                             -1e-3, 0, 0])]


def directions(widest: float) -> np.ndarray:
    """Return unit vectors up to an angle from the optical axis, the axis itself among them."""
    angle, turn = np.meshgrid(np.linspace(0, widest, 12), np.linspace(0, 6.2, 9))
    angle, turn = angle.ravel(), turn.ravel()
    return np.stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)], 1)


@pytest.mark.parametrize(('model', 'coefficients'), PINHOLES)
def test_pinholes_undo_what_opencv_does(model, coefficients):
    wanted = directions(0.6)
    pixels, _ = cv2.projectPoints(wanted, np.zeros(3), np.zeros(3), MATRIX,
                                  np.array(coefficients, float))
    camera = CameraModel(model, MATRIX, np.array(coefficients, float))
    assert np.abs(camera.rays(pixels.reshape(-1, 2)) - wanted).max() < 1e-8


@pytest.mark.parametrize('widest', [0.9, np.pi / 2, 1.9])
def test_equidistant_reaches_behind_the_camera(widest):
    k = np.array([-0.01, 0.005, -0.002, 0.0003])
    wanted = directions(widest)
    angle = np.arccos(wanted[:, 2])
    radius = angle * (1 + sum(k[i] * angle ** (2 * i + 2) for i in range(4)))
    side = wanted[:, :2] / np.maximum(np.hypot(*wanted[:, :2].T), 1e-300)[:, None]
    pixels = (radius[:, None] * side) * np.diag(MATRIX)[:2] + MATRIX[:2, 2]
    assert np.abs(CameraModel('equidistant', MATRIX, k).rays(pixels) - wanted).max() < 1e-8


def test_rays_keep_the_shape_and_have_length_1():
    rays = CameraModel('plumb_bob', MATRIX, np.zeros(5)).rays(np.zeros((3, 4, 2)))
    assert rays.shape == (3, 4, 3)
    assert np.allclose(np.linalg.norm(rays, axis=-1), 1)


@pytest.mark.parametrize(('model', 'coefficients'), [
    ('plumb_bob', [-0.8]), ('rational_polynomial', [-0.8]), ('equidistant', [-0.4])])
def test_what_no_direction_is_mapped_to_is_nan(model, coefficients):
    camera = CameraModel(model, MATRIX, np.array(coefficients))
    inner, outer = camera.rays(np.array([[330.0, 240.0], [900.0, 900.0]]))
    assert np.isfinite(inner).all() and np.isnan(outer).all()


@pytest.mark.parametrize(('model', 'matrix', 'coefficients', 'text'), [
    ('fov', MATRIX, [], "'fov': must be one of plumb_bob, rational_polynomial, equidistant"),
    ('plumb_bob', MATRIX, [0.1] * 6, 'at most 5'),
    ('rational_polynomial', MATRIX, [0.1] * 14, 'at most 12'),
    ('plumb_bob', np.zeros((3, 3)), [], 'not calibrated'),
    ('plumb_bob', MATRIX, [np.nan], 'not calibrated')])
def test_what_cannot_be_used_is_named(model, matrix, coefficients, text):
    with pytest.raises(ValueError, match=text):
        CameraModel(model, matrix, np.array(coefficients))
