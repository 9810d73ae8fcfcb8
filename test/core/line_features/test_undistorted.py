"""Arcs become the lines that a camera without distortion would see."""
from __future__ import annotations

import numpy as np
import pytest
from qflsd_ros.core import Detector, DivisionModel
from qflsd_ros.core.arcs import Arcs, TABLE
from qflsd_ros.core.geometry.planes import planes
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.conversion import calibration_terms, natural_focal_length
from qflsd_ros.core.line_features.undistorted import Lines, undistorted, WIDEST
from qflsd_ros.sources import Scene, SceneFrames

K = np.array([[300.0, 0, 320], [0, 300.0, 240], [0, 0, 1]])


def arcs_of(*circles: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Arcs:
    """Return the arcs through start, middle and end, px."""
    table = np.zeros(len(circles), TABLE)
    for row, (start, middle, end) in zip(table, circles):
        chord = end - start
        side = middle - (start + end) / 2
        sagitta = (chord[0] * side[1] - chord[1] * side[0]) / np.hypot(*chord)
        half = 2 * np.arctan(2 * sagitta / np.hypot(*chord))
        row['start'], row['middle'], row['end'] = start, middle, end
        row['length'] = np.hypot(*chord) / np.sinc(half / np.pi)
        row['curvature'] = -2 * half / row['length']
        row['offset_std'], row['bent'] = 0.1, 1
    return Arcs(table, np.zeros((0, 2)), np.zeros((0, 2), np.int32),
                np.zeros(len(table) + 1, np.int64))


def lines_of(arcs: Arcs, camera: CameraModel) -> Lines:
    return undistorted(arcs, planes(arcs, camera), camera)


def test_pinhole_lines_are_the_normalised_segments():
    start, end = np.array([100.0, 50]), np.array([400.0, 350])
    lines = lines_of(arcs_of((start, (start + end) / 2, end)), CameraModel('plumb_bob', K, [0.0]))
    assert lines.arcs.tolist() == [0]
    assert lines.starts[0] == pytest.approx((start - (320, 240)) / 300, abs=1e-12)
    assert lines.ends[0] == pytest.approx((end - (320, 240)) / 300, abs=1e-12)
    assert lines.lengths[0] == pytest.approx(np.hypot(300, 300))


def test_deviation_is_that_of_simulated_ends():
    """Of noise in the position of an arc, in its turn too."""
    camera = CameraModel('plumb_bob', K, [0.0])
    start, end = np.array([420.0, 300]), np.array([540.0, 260])
    line, = (lines_of(arcs_of((start, (start + end) / 2, end)), camera),)
    across = np.array([-(end - start)[1], (end - start)[0]]) / np.hypot(*(end - start))
    # Points spread evenly along: independent shift and turn, as planes takes them for bent ones.
    random = np.random.default_rng(0)
    shift, turn = random.standard_normal((2, 4000)) * 0.1 * 2 / 3
    offsets = np.stack([shift - np.sqrt(3) * turn, shift + np.sqrt(3) * turn])
    assert np.abs(across).max() > 0
    assert line.std[0] == pytest.approx(np.sqrt((offsets ** 2).mean()) / 300, rel=0.05)


@pytest.mark.parametrize('lam', [0.1, 0.0, -0.5, -0.7])
def test_lines_of_the_room_lie_on_its_edges(lam: float) -> None:
    """By the true pose, the lines are the projections of true edges."""
    scene = Scene(640, 480, lam)
    camera, pose = SceneFrames(scene).camera, scene.pose(90)
    lines = lines_of(Detector().detect(scene.image(90)), camera)
    assert len(lines.arcs) > 60
    true = (scene._edge_ends - pose[:3, 3]) @ pose[:3, :3]
    normals = np.cross(true[:, 0], true[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    rays = np.stack([np.c_[ends, np.ones(len(ends))] for ends in (lines.starts, lines.ends)])
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    off = np.abs(rays @ normals.T).max(axis=0).min(axis=1) * camera.matrix[0, 0]    # px
    # The others are of the grain of wood.
    long = off[lines.lengths > 60]
    assert np.median(long) < 0.2 and (long < 1).mean() > 0.65


def fisheye() -> tuple[CameraModel, DivisionModel, float]:
    lens = DivisionModel(-1.3, (480, 640))
    focal = natural_focal_length(lens)
    terms = calibration_terms(lens, focal)
    return CameraModel(terms.distortion_model, terms.matrix, terms.coefficients), lens, focal


def image_of(points: np.ndarray, lens: DivisionModel, focal: float) -> np.ndarray:
    """Project directions, (N, 3), through a lens: (N, 2) px."""
    side, depth = points[:, :2], points[:, 2:] * lens.half_diagonal / focal
    root = np.sqrt(depth ** 2 - 4 * lens.lam * (side ** 2).sum(axis=1, keepdims=True))
    return 2 * side / (depth + root) * lens.half_diagonal + lens.origin


@pytest.mark.parametrize(('first', 'last', 'share'), [
    (-40, 40, 1.0), (-100, 30, 110 / 130), (20, 100, 60 / 80), (-89, 89, 160 / 178),
    (85, 100, None), (-100, -85, None)])
def test_lines_end_at_80_degrees(first: float, last: float, share: float | None) -> None:
    """Of a vertical plane through the optical axis, between two angles from it in degrees."""
    camera, lens, focal = fisheye()
    angles = np.radians([first, (first + last) / 2, last])
    rays = np.stack([np.zeros(3), np.sin(angles), np.cos(angles)], axis=1)
    lines = lines_of(arcs_of(tuple(image_of(rays, lens, focal))), camera)
    if share is None:
        assert len(lines.arcs) == 0
        return
    farthest = np.tan(WIDEST)
    assert lines.starts[0] == pytest.approx(
        (0, max(np.tan(angles[0]) if first > -90 else -np.inf, -farthest)), abs=0.02)
    assert lines.ends[0] == pytest.approx(
        (0, min(np.tan(angles[2]) if last < 90 else np.inf, farthest)), abs=0.02)
    whole = np.hypot(*(image_of(rays, lens, focal)[2] - image_of(rays, lens, focal)[0]))
    assert lines.lengths[0] == pytest.approx(share * whole, rel=0.02)
    assert np.isfinite(lines.std).all()


def test_oblique_lines_of_a_fisheye_are_straight() -> None:
    """Parts of a true line, some of which reach beyond 90 degrees, give the same line."""
    camera, lens, focal = fisheye()
    places = np.array([0.6, 0.5, 0.4]) + np.outer(np.linspace(-4, 4, 9), [1.0, 0.2, -0.5])
    parts = [image_of(places[[i, i + 1, i + 2]], lens, focal) for i in range(7)]
    circles = []
    for i, part in enumerate(parts):
        middle = np.cross(places[i], places[i + 2])
        middle = np.cross(middle, places[i] / np.linalg.norm(places[i])
                          - places[i + 2] / np.linalg.norm(places[i + 2]))
        middle *= np.sign(middle @ places[i + 1])
        circles.append((part[0], image_of(middle[None], lens, focal)[0], part[2]))
    lines = lines_of(arcs_of(*circles), camera)
    assert 3 <= len(lines.arcs) < 7
    normal = np.cross(places[0], places[-1])
    normal /= np.hypot(*normal[:2])
    for ends in (lines.starts, lines.ends):
        assert np.hypot(*ends.T).max() <= np.tan(WIDEST) + 1e-9
        assert np.abs(np.c_[ends, np.ones(len(ends))] @ normal).max() < 0.02


def test_what_is_bent_in_space_is_no_line():
    start, end = np.array([100.0, 100]), np.array([200.0, 100])
    camera = CameraModel('plumb_bob', K, [0.0])
    for sagitta, count in ((0.5, 1), (2.0, 0), (-5.0, 0)):
        arcs = arcs_of((start, (start + end) / 2 + (0, sagitta), end))
        assert len(lines_of(arcs, camera).arcs) == count


def test_no_arcs_give_no_lines():
    lines = lines_of(Arcs.empty(), CameraModel('equidistant', K, [0.0]))
    assert len(lines.arcs) == 0 and lines.starts.shape == lines.ends.shape == (0, 2)
