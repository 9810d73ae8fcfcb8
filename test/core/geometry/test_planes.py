"""Planes through the optical centre, against edges in space and against repeated noise."""
from __future__ import annotations

from collections.abc import Iterator

from finding import find
import numpy as np
import pytest
from qflsd_ros.core import Arcs, DivisionModel
from qflsd_ros.core.arcs import TABLE
from qflsd_ros.core.geometry.planes import planes
from qflsd_ros.core.lens.camera_model import CameraModel
from rendering import polygon, render, through_lens

MATRIX = np.array([[400.0, 0, 320], [0, 400, 240], [0, 0, 1]])
STRAIGHT = CameraModel('plumb_bob', MATRIX, np.zeros(5))
FISHEYE = CameraModel('equidistant', MATRIX, np.zeros(4))


def through(points: np.ndarray) -> Arcs:
    """Return the arcs through start, middle and end, (M, 3, 2) px."""
    table = np.zeros(len(points), TABLE)
    table['start'], table['middle'], table['end'] = points.transpose(1, 0, 2)
    chord = points[:, 2] - points[:, 0]
    size = np.hypot(*chord.T)
    across = np.stack([-chord[:, 1], chord[:, 0]], 1) / size[:, None]
    bow = ((points[:, 1] - (points[:, 0] + points[:, 2]) / 2) * across).sum(1)
    half = 2 * np.arctan(2 * bow / size)
    table['curvature'] = -2 * np.sin(half) / size
    table['length'] = size / np.sinc(half / np.pi)
    return Arcs(table, np.zeros((0, 2)), np.zeros((0, 2), np.int32),
                np.zeros(len(points) + 1, np.int64))


def equidistant(points: np.ndarray) -> np.ndarray:
    """Return where FISHEYE shows points in space, (..., 3)."""
    side = np.hypot(points[..., 0], points[..., 1])
    angle = np.arctan2(side, points[..., 2])
    return points[..., :2] * (400 * angle / side)[..., None] + MATRIX[:2, 2]


def edges(count: int) -> np.ndarray:
    """Return start, middle and end of edges in space: (count, 3, 3) m."""
    random = np.random.default_rng(1)
    start = random.uniform((-2, -1.5, 1.5), (2, 1.5, 4), (count, 3))
    end = start + random.uniform(-0.4, 0.4, (count, 3))
    return np.stack([start, (start + end) / 2, end], 1)


def test_a_lens_without_distortion():
    lines = edges(20)
    pixels = lines[..., :2] / lines[..., 2:] * 400 + MATRIX[:2, 2]
    pixels[:, 1] = (pixels[:, 0] + pixels[:, 2]) / 2
    found = planes(through(pixels), STRAIGHT)
    wanted = np.cross(lines[:, 0], lines[:, 2])
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    assert found.arcs.tolist() == list(range(20))
    assert found.normals == pytest.approx(wanted, abs=1e-9)


def test_rays_of_the_ends():
    lines = edges(20)
    pixels = lines[..., :2] / lines[..., 2:] * 400 + MATRIX[:2, 2]
    pixels[:, 1] = (pixels[:, 0] + pixels[:, 2]) / 2
    rays = planes(through(pixels), STRAIGHT).ends
    wanted = lines[:, [0, 2]] / np.linalg.norm(lines[:, [0, 2]], axis=2, keepdims=True)
    assert rays == pytest.approx(wanted, abs=1e-9)


def test_arcs_of_a_fisheye_lie_in_the_planes_of_their_edges():
    lines = edges(50)
    wanted = np.cross(lines[:, 0], lines[:, 2])
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    normals = planes(through(equidistant(lines)), FISHEYE).normals
    # These short pictures of edges are all but arcs: off by less than a twentieth of a pixel.
    assert (normals * wanted).sum(1).min() > np.cos(np.radians(0.3))
    angles = np.arcsin(np.abs(np.einsum('ni,nki->nk', normals, lines))
                       / np.linalg.norm(lines, axis=2))
    assert 400 * angles.max() < 0.05


def test_the_normal_points_to_the_brighter_side():
    level = through(np.array([[[300.0, 260], [320, 260], [340, 260]]]))  # brighter below
    normal, = planes(level, STRAIGHT).normals
    assert normal[1] > 0.99


@pytest.mark.parametrize('lens', [STRAIGHT, FISHEYE])
@pytest.mark.parametrize('bow', [0.0, 6.0])
def test_covariance_is_that_of_repeated_noise(lens, bow):
    """Fit a line or a parabola to noisy points across, as the detector does."""
    random, sigma, count, length = np.random.default_rng(2), 0.3, 80, 80.0
    along = np.linspace(-length / 2, length / 2, count)
    basis = np.stack([np.ones(count), along, along ** 2])[:3 if bow else 2]
    shape = bow * (1 - (2 * along / length) ** 2)
    fits = np.linalg.lstsq(basis.T, (shape + random.normal(0, sigma, (4000, count))).T,
                           rcond=None)[0].T
    ends = np.array([-length / 2, 0, length / 2])
    offsets = fits @ np.stack([np.ones(3), ends, ends ** 2])[:len(basis)]
    direction = np.array([0.8, 0.6])
    across = np.array([-0.6, 0.8])
    pixels = np.array([400.0, 300.0]) + ends[:, None] * direction \
        + offsets[..., None] * across
    normals = planes(through(pixels), lens).normals
    arcs = through(pixels.mean(0, keepdims=True))
    inverse = np.linalg.inv(basis @ basis.T) * sigma ** 2
    arcs.table['offset_std'] = np.sqrt(inverse[0, 0])
    free = np.stack([np.ones(count), along, along ** 2])
    arcs.table['curvature_std'] = 2 * sigma * np.sqrt(np.linalg.inv(free @ free.T)[2, 2])
    arcs.table['bent'] = bow > 0
    covariance, = planes(arcs, lens).covariances
    seen = np.cov(normals.T)
    assert np.abs(covariance - seen).max() < 0.12 * np.abs(seen).max()
    values = np.linalg.eigvalsh(covariance)
    assert values[1:] == pytest.approx(np.linalg.eigvalsh(seen)[1:], rel=0.15)
    assert abs(values[0]) < 1e-6 * values[2]


@pytest.mark.parametrize('offset_std, curvature_std', [(0.0, 0.0), (0.0, 1e-4), (0.1, 0.0)])
@pytest.mark.parametrize('bent', [0, 1])
def test_deviations_of_0(offset_std, curvature_std, bent):
    """As of the exact arcs of a rendered scene: the covariance is finite, and no warning comes."""
    arcs = through(np.array([[[300.0, 200], [350, 210], [400, 220]]]))
    arcs.table['offset_std'], arcs.table['curvature_std'] = offset_std, curvature_std
    arcs.table['bent'] = bent
    with np.errstate(divide='raise', invalid='raise'):
        covariance, = planes(arcs, STRAIGHT).covariances
    assert np.isfinite(covariance).all()
    assert (np.trace(covariance) > 0) == (offset_std > 0 or curvature_std > 0)


def test_arcs_that_the_lens_cannot_show_have_no_plane():
    lens = CameraModel('plumb_bob', MATRIX, np.array([-0.8]))
    inside = [[320.0, 230], [330, 230], [340, 230]]
    outside = [[900.0, 900], [910, 900], [920, 900]]
    found = planes(through(np.array([outside, inside])), lens)
    assert found.arcs.tolist() == [1]
    assert len(planes(Arcs.empty(), lens).normals) == 0


class DivisionLens:
    """A lens that follows the division model exactly, its focal length half the diagonal."""

    def __init__(self, model: DivisionModel) -> None:
        self.model = model

    def rays(self, points: np.ndarray) -> np.ndarray:
        plane = (self.model.undistort(points) - self.model.origin) / self.model.half_diagonal
        rays = np.concatenate([plane, np.ones((*plane.shape[:-1], 1))], axis=-1)
        return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


TURNS = 5


def scenes(lens: DivisionLens, length: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Return images of bars, and the normal of the plane of one of their sides."""
    model = lens.model
    for turn in np.random.default_rng(0).uniform(0, 2 * np.pi, TURNS):
        along = np.array([np.cos(turn), np.sin(turn)])
        across = np.array([-along[1], along[0]])
        corners = [model.origin + (20 + side) * across + end * length / 2 * along
                   for side, end in ((0, -1), (0, 1), (40, 1), (40, -1))]
        region = polygon([tuple(corner) for corner in corners])
        normal = np.cross(*lens.rays(model.distort(np.array(corners[:2]))))
        yield (render(model.shape, through_lens(region, model), blur=0.6),
               normal / np.linalg.norm(normal))


def normalised_errors(lam: float, known: bool, noise: float, length: float,
                      count: int) -> list[float]:
    """Return e' C^+ e / 2 of normals, of ``count`` images for each turn of a bar."""
    lens, errors = DivisionLens(DivisionModel(lam, (int(length) + 100,) * 2)), []
    for gray, wanted in scenes(lens, length):
        for seed in range(count):
            noisy = gray + np.random.default_rng(seed).normal(0, noise, gray.shape)
            arcs = find(noisy.round().astype(np.uint8), lens.model if known else None)
            found = planes(arcs, lens)
            off = found.normals - wanted
            nearest = np.argmin(np.linalg.norm(off, axis=1))
            inverse = np.linalg.pinv(found.covariances[nearest], rcond=1e-6, hermitian=True)
            errors.append(off[nearest] @ inverse @ off[nearest] / 2)
    return errors


@pytest.mark.slow
@pytest.mark.parametrize('lam, known', [(0.0, False), (-0.3, False), (-0.3, True)])
def test_covariance_is_that_of_the_errors(lam, known):
    errors = np.array([[np.mean(normalised_errors(lam, known, noise, length, 15))
                        for length in (40.0, 100.0, 300.0)] for noise in (1.0, 2.0, 5.0)])
    assert 0.8 < errors.mean() < 1.25
    assert 0.45 < errors.min() and errors.max() < 1.7
