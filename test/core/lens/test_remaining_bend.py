"""A wrong calibration leaves straight edges bent, the right one does not."""
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from qflsd_ros.core import Arcs, Detector, DivisionModel
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.conversion import camera_info_terms
from qflsd_ros.core.lens.remaining_bend import CalibrationWatch, remaining_bend
from qflsd_ros.core.lens.tracker import LensTracker
from qflsd_ros.sources import Scene
from qflsd_ros.sources.scene.optics import FOCAL
from seen import arcs_of, edges

LAM, SHAPE = -0.6, (480, 640)
LENS = DivisionModel(LAM, SHAPE)


def calibration(lens: DivisionModel, off: tuple[float, float] = (0.0, 0.0)) -> CameraModel:
    terms = camera_info_terms(lens, FOCAL * lens.half_diagonal)
    matrix = terms.matrix.copy()
    matrix[:2, 2] += off
    return CameraModel(terms.distortion_model, matrix, terms.coefficients)


@pytest.fixture(scope='module')
def frames() -> list[tuple[Arcs, DivisionModel | None]]:
    """Return arcs and lens of some frames of 3 s in the rendered room."""
    scene, detector, lenses, found = Scene(640, 480, LAM, 2.0), Detector(), LensTracker(), []
    for number in range(0, 90, 5):
        arcs = detector.detect(scene.image(number))
        lenses.add(arcs, SHAPE)
        found.append((arcs, lenses.estimate and lenses.estimate.model))
    return found


def watched(frames: list[tuple[Arcs, DivisionModel | None]], camera: CameraModel
            ) -> CalibrationWatch:
    watch = CalibrationWatch()
    for arcs, lens in frames:
        for _ in range(5):
            watch.add(arcs, SHAPE, lens, camera)
    return watch


def test_the_right_calibration(frames):
    bend = watched(frames, calibration(LENS)).bend
    assert bend.rms + 2 * bend.std < 0.3 and bend.share > 0.5


@pytest.mark.parametrize('camera', [
    calibration(replace(LENS, lam=0.85 * LAM)), calibration(replace(LENS, lam=1.15 * LAM)),
    calibration(LENS, (32, 0)), calibration(LENS, (0, 32)),
    calibration(replace(LENS, lam=-0.3)), calibration(LENS, (-80, -60))],
    ids=['less', 'more', 'right', 'down', 'another camera', 'another crop'])
def test_wrong_calibrations(frames, camera):
    bend = watched(frames, camera).bend
    assert bend.rms - 2 * bend.std > 0.5


def test_the_bend_is_that_of_the_geometry():
    """Straight lines that a calibration bends: the sagitta of each is computed by itself."""
    arcs = arcs_of(edges(DivisionModel(0.0, SHAPE), 60, 0, (150, 200)), noise=0.0)
    camera = calibration(replace(LENS, lam=-0.1))
    found = remaining_bend(arcs, SHAPE, None, camera)
    sagittas = []
    for row in arcs.table:
        plane = np.cross(*camera.rays(np.array([row['start'], row['end']])))
        chord = row['end'] - row['start']
        across = np.array([-chord[1], chord[0]]) / np.hypot(*chord)
        steps = np.linspace(-8, 8, 1601)
        heights = camera.rays((row['start'] + row['end']) / 2 + steps[:, None] * across) @ plane
        sagittas.append(steps[np.argmin(np.abs(heights))])
    assert found.rms == pytest.approx(np.sqrt(np.mean(np.square(sagittas))), rel=0.1)


def test_few_lines_have_no_verdict():
    watch = CalibrationWatch()
    watch.add(arcs_of(edges(LENS, 5, 0)), SHAPE, LENS, calibration(LENS))
    watch.add(Arcs.empty(), SHAPE, LENS, calibration(LENS))
    assert watch.bend is None


def test_another_calibration_starts_anew(frames):
    watch = watched(frames, calibration(LENS, (32, 0)))
    watch.add(Arcs.empty(), SHAPE, LENS, calibration(LENS))
    assert watch.bend is None
