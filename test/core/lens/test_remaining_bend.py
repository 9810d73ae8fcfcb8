"""A wrong calibration leaves straight edges bent, the right one does not."""
from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from qflsd_ros.core import Arcs, Detector, DivisionModel
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.conversion import camera_info_terms
from qflsd_ros.core.lens.remaining_bend import BendTracker, EVERY, remaining_bend
from qflsd_ros.core.lens.tracker import LensTracker
from qflsd_ros.sources import Scene
from seen import arcs_of, edges

SHAPE = (480, 640)
LENS = DivisionModel(-0.6, SHAPE)
# Lens and first frame of a way through the room.
WAYS = (-0.6, 0), (-0.6, 300), (-0.3, 600), (-0.9, 900)

Frames = list[tuple[Arcs, DivisionModel | None]]


def calibration(lens: DivisionModel, off: tuple[float, float] = (0.0, 0.0)) -> CameraModel:
    """Return the lens as a calibration, its centre moved by some px."""
    terms = camera_info_terms(lens)     # straight edges are straight at any focal length
    matrix = terms.matrix.copy()
    matrix[:2, 2] += off
    return CameraModel(terms.distortion_model, matrix, terms.coefficients)


@lru_cache
def frames(lam: float, first: int) -> Frames:
    """Return arcs and lens of some frames of 3 s in the rendered room."""
    scene, detector, lenses, found = Scene(640, 480, lam, 2.0), Detector(), LensTracker(), []
    for number in range(first, first + 90, EVERY):
        arcs = detector.detect(scene.image(number))
        lenses.add(arcs, SHAPE)
        found.append((arcs, lenses.estimate and lenses.estimate.model))
    return found


def followed(frames: Frames, camera: CameraModel) -> BendTracker:
    bends = BendTracker()
    for arcs, lens in frames:
        for _ in range(EVERY):
            bends.add(arcs, SHAPE, lens, camera)
    return bends


@pytest.mark.parametrize('lam, first', WAYS)
def test_the_right_calibration(lam, first):
    bend = followed(frames(lam, first), calibration(DivisionModel(lam, SHAPE))).bend
    assert bend.rms < 0.48 and bend.std < 0.1 and bend.share > 0.5


@pytest.mark.parametrize('lam, first', WAYS)
@pytest.mark.parametrize('factor, off', [
    (0.85, (0, 0)), (1.15, (0, 0)), (1, (32, 0)), (1, (-32, 0)), (1, (0, 32)), (1, (0, -32)),
    (1.7, (0, 0)), (1, (-80, -60))],
    ids=['less', 'more', 'right', 'left', 'down', 'up', 'another camera', 'another crop'])
def test_wrong_calibrations(lam, first, factor, off):
    camera = calibration(DivisionModel(factor * lam, SHAPE), off)
    bend = followed(frames(lam, first), camera).bend
    assert bend.rms - 2 * bend.std > 0.5


def test_without_a_lens_a_wrong_calibration_is_seen_all_the_same():
    alone = [(arcs, None) for arcs, _ in frames(-0.6, 0)]
    assert followed(alone, calibration(LENS)).bend.rms < 0.3
    bend = followed(alone, calibration(replace(LENS, lam=-0.3))).bend
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
    bends = BendTracker()
    bends.add(arcs_of(edges(LENS, 5, 0)), SHAPE, LENS, calibration(LENS))
    bends.add(Arcs.empty(), SHAPE, LENS, calibration(LENS))
    assert bends.bend is None


def test_another_calibration_starts_anew():
    bends = followed(frames(-0.6, 0), calibration(LENS, (32, 0)))
    assert bends.bend is not None
    bends.add(Arcs.empty(), SHAPE, LENS, calibration(LENS))
    assert bends.bend is None
