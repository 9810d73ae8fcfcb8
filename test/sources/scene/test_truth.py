"""The scene's exact arcs: against the lens model, brute force, and the rendered images."""
from __future__ import annotations

import cv2
import numpy as np
import pytest
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.sources.scene.optics import Camera
from qflsd_ros.sources.scene.raycast import render, TEXTURE_SIZE
from qflsd_ros.sources.scene.room import furnish, viewpoint
from qflsd_ros.sources.scene.scene import Scene
from qflsd_ros.sources.scene.solids import Box, edges, Patch, surfaces
from qflsd_ros.sources.scene.truth import visible_arcs

DARK, BRIGHT = 40.0, 220.0
LENSES = (-1.0, -0.5, 0.0, 0.4)


def rotation(yaw: float, pitch: float, roll: float) -> np.ndarray:
    """Return camera axes that look along +x, turned by three angles in radians."""
    vector = cv2.Rodrigues(np.array([roll, pitch, yaw]))[0]
    return np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0.0]]) @ vector.T


def two_tone(patches: dict[str, list[Patch]], more: list[Box], camera: Camera) -> tuple:
    """Return the image and the truth of a room with nothing but what is given."""
    boxes = [Box((0, 0, 0), (8, 8, 8), (0, 0, 0), patches=patches), *more]
    tables = surfaces(boxes, (0, 0, 0))
    tables.boxes[['eye_x', 'eye_y', 'eye_z']] = [tuple(box.local(camera.position))
                                                 for box in boxes]
    lines = edges(boxes)
    ends = np.array([(line.start, line.end) for line in lines])
    texture = np.zeros((TEXTURE_SIZE, TEXTURE_SIZE), np.float32)
    noise = np.zeros(1, np.float32)
    image = render(tables, ends, camera, tables.colours[:, :1].copy(), texture, noise)[..., 0]
    return image, visible_arcs(lines, boxes, camera, image)


def flat(start: tuple[float, float], size: tuple[float, float], level: float) -> Patch:
    """Return a patch of exactly one grey level."""
    return Patch(start, size, np.full((1, 1, 3), level), glow=1.0, grain=(1.0, 1.0, 0.0))


def row_of_edge(column: np.ndarray, near: float) -> float:
    """Return at which y near a given one a column turns from bright to dark, or back, in px."""
    first = round(near) - 8
    share = (column[first:first + 17].astype(float) - DARK) / (BRIGHT - DARK)
    return first - 0.5 + (share if share[0] > 0.5 else 1 - share).sum()


@pytest.mark.parametrize('lam', LENSES)
@pytest.mark.parametrize('angles', [(0.1, 0.03, 0.0), (-0.2, -0.05, 0.21), (0.0, 0.15, -0.4)])
@pytest.mark.parametrize('is_box', [False, True])
def test_edges_lie_where_the_truth_says(lam, angles, is_box):
    """Locate an edge by its area in every column: neither pattern nor box is off by 0.02 px."""
    camera = Camera(DivisionModel(lam, (120, 160)), np.array([0.3, 0.2, 0.1]), rotation(*angles))
    upper = flat((0, 4), (8, 4), BRIGHT)
    wall = {'east': [flat((0, 0), (8, 8), DARK), *([] if is_box else [upper])]}
    front = Box((3, 0, 2), (1, 8, 4), (0, 0, 0),
                patches={'west': [flat((0, 0), (8, 4), BRIGHT)],
                         'bottom': [flat((0, 0), (1, 8), BRIGHT)]})
    image, truth = two_tone(wall, [front] if is_box else [], camera)
    columns = np.arange(55, 106)
    level = camera.project(np.c_[np.full(2000, 2.5 if is_box else 4.0),
                                 np.linspace(3.9, -3.9, 2000), np.zeros(2000)])
    middle = level[np.argmin(np.abs(level[:, 0] - 80))]
    points = min(truth.polylines(1e-4), key=lambda line: distance(middle, line[:-1], line[1:]))
    wanted = np.mean([np.interp(columns + shift, *points[np.argsort(points[:, 0])].T)
                      for shift in np.linspace(-0.5, 0.5, 21)], axis=0)
    error = [row_of_edge(image[:, column], y) for column, y in zip(columns, wanted)] - wanted
    assert np.abs(error).max() < 0.02
    assert abs(error.mean()) < 0.005


@pytest.mark.parametrize('lam', LENSES)
def test_truth_is_straight_where_the_lens_is_undone(lam):
    truth = Scene(320, 240, lam).truth(700)
    assert len(truth) > 60
    lens = DivisionModel(lam, (240, 320))
    for row, line in zip(truth.table, truth.polylines(0.01)):
        points = np.concatenate([[row['start'], row['middle'], row['end']], line])
        # At the border of a lens of 180 degrees the undistorted image is infinitely far away.
        if np.hypot(*((points - lens.origin) / lens.half_diagonal).T).max() < 0.95:
            straight = lens.undistort(points)
            across = straight - straight.mean(axis=0)
            assert np.linalg.svd(across, compute_uv=False)[1] < 1e-6


def test_middle_and_length_belong_to_the_arc():
    truth = Scene(320, 240, -0.5).truth(300)
    for row, line in zip(truth.table, truth.polylines(1e-4)):
        steps = np.hypot(*np.diff(line, axis=0).T)
        assert steps.sum() == pytest.approx(row['length'], rel=1e-3)
        way = np.concatenate([[0], steps.cumsum()])
        halfway = [np.interp(way[-1] / 2, way, line[:, k]) for k in (0, 1)]
        assert np.hypot(*(halfway - row['middle'])) < 1e-3
        assert line[0] == pytest.approx(row['start']) and line[-1] == pytest.approx(row['end'])


def hidden_by_brute_force(points: np.ndarray, boxes: list[Box], eye: np.ndarray) -> np.ndarray:
    """Tell of (N, 3) points whether the way to them leads through a box: ray against slabs."""
    hidden = np.zeros(len(points), bool)
    for box in boxes[1:]:
        start, way = box.local(eye), (points - eye) @ box.rotation()
        with np.errstate(divide='ignore'):
            ends = np.stack([(-np.array(box.size) / 2 - start) / way,
                             (np.array(box.size) / 2 - start) / way])
        enter, leave = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
        hidden |= (enter < leave - 1e-6) & (enter > 0) & (enter < 1 - 1e-6)
    return hidden


@pytest.mark.parametrize(('lam', 'number'), [(-0.8, 480), (0.2, 900)])
def test_what_is_visible_is_in_the_truth(lam, number):
    """Sample every edge: what no box hides lies on an arc of the truth."""
    boxes = furnish(0)
    camera = Camera(DivisionModel(lam, (150, 200)), *viewpoint(number / 1200))
    lines = Scene(200, 150, lam).truth(number).polylines(0.01)
    starts, ends = np.concatenate([np.stack([line[:-1], line[1:]], axis=1)
                                   for line in lines]).swapaxes(0, 1)
    for edge in edges(boxes):
        points = edge.start + np.linspace(0, 1, 21)[:, None] * (edge.end - edge.start)
        # A little off its own box, so that only those on its front can be seen.
        off = points + 1e-5 * (points - boxes[edge.box].centre) * (-1 if edge.box == 0 else 1)
        visible = ~hidden_by_brute_force(off, boxes, camera.position)
        seen = camera.project(points)
        seen = seen[visible & (np.abs(seen - [99.5, 74.5]) < [99, 74]).all(axis=1)]
        if len(seen) and np.ptp(seen, axis=0).max() > 2:
            assert max(distance(point, starts, ends) for point in seen) < 0.05


@pytest.mark.parametrize(('lam', 'number'), [(-0.8, 480), (0.2, 900)])
def test_what_is_in_the_truth_is_visible(lam, number):
    """Follow the ray through the middle of every arc: it meets an edge that no box hides."""
    boxes = furnish(0)
    camera = Camera(DivisionModel(lam, (150, 200)), *viewpoint(number / 1200))
    ends = np.array([(edge.start, edge.end) for edge in edges(boxes)]) - camera.position
    normals, along = np.cross(ends[:, 0], ends[:, 1]), ends[:, 1] - ends[:, 0]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    for middle in Scene(200, 150, lam).truth(number).table['middle']:
        ray = camera.rays(middle)
        ray /= np.linalg.norm(ray)
        met = np.abs(normals @ ray) < 1e-9
        share = -(np.cross(ends[met, 0], ray) * normals[met]).sum(axis=1) / (
            np.cross(along[met], ray) * normals[met]).sum(axis=1)
        points = (ends[met, 0] + share[:, None] * along[met])[(0 <= share) & (share <= 1)]
        assert not hidden_by_brute_force(points + camera.position, boxes, camera.position).all()


def test_strong_edges_of_the_image_are_in_the_truth():
    scene = Scene(640, 480, noise=0.0)
    for number in (0, 300, 600):
        image, truth = scene.frame(number)
        drawn = np.full(image.shape, 255, np.uint8)
        for line in truth.polylines(0.1):
            cv2.polylines(drawn, [np.rint(line * 16).astype(np.int32)], False, 0, 1, shift=4)
        away = cv2.distanceTransform(drawn, cv2.DIST_L2, 5)
        step = np.hypot(*(cv2.Sobel(image, cv2.CV_32F, x, 1 - x) / 8 for x in (0, 1)))
        assert (step > 25).sum() > 2000
        # The brush strokes of a painting make the rest.
        assert np.mean(away[step > 25] < 2.5) > 0.98


def test_contrast_is_the_step_across_the_edge():
    camera = Camera(DivisionModel(-0.3, (120, 160)), np.zeros(3), rotation(0.0, 0.0, 0.1))
    wall = [flat((0, 0), (8, 8), DARK), flat((3, 3), (2, 2), BRIGHT)]
    truth = two_tone({'east': wall}, [], camera)[1]
    nearest = np.argsort(np.hypot(*(truth.table['middle'] - [79.5, 59.5]).T))[:4]
    assert truth.table['contrast'][nearest] == pytest.approx(BRIGHT - DARK, abs=8)
    assert (truth.table['polarity'][nearest] == 1).all()
    # The brighter side, here the inside, is to the right of all four: clockwise on the screen.
    start, end = (truth.table[name][nearest] - [79.5, 59.5] for name in ('start', 'end'))
    assert (start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0] > 0).all()


def distance(point: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> float:
    """Return the distance in px of a point from the nearest of (N, 2) line segments."""
    along = ends - starts
    share = ((point - starts) * along).sum(axis=1) / (along ** 2).sum(axis=1)
    nearest = starts + np.clip(share, 0, 1)[:, None] * along
    return float(np.hypot(*(nearest - point).T).min())
