"""Rendered scenes: their truth lies on their edges, through every lens."""
from __future__ import annotations

from benchmark.scenes import planes
from benchmark.scenes.lenses import EquidistantLens, Lens
from benchmark.scenes.rendered import sagitta
import numpy as np
import pytest
from qflsd_ros.core import DivisionModel
from scipy.ndimage import map_coordinates, spline_filter

SHAPE = 240, 320
LENSES = DivisionModel(0.0, SHAPE), DivisionModel(-0.5, SHAPE), EquidistantLens(130.0, SHAPE)


def values(splines: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return grey levels at (N, 2) px from the coefficients of cubic splines."""
    return map_coordinates(splines, points[:, ::-1].T, order=3, mode='nearest', prefilter=False)


@pytest.mark.parametrize('lens', LENSES, ids=str)
def test_lenses_map_there_and_back(lens: Lens) -> None:
    """``distort`` is the inverse of ``undistort`` all over the image."""
    y, x = np.mgrid[:SHAPE[0]:7, :SHAPE[1]:7]
    points = np.stack([x, y], axis=-1).astype(float)
    np.testing.assert_allclose(lens.distort(lens.undistort(points)), points, atol=1e-6)


def test_an_equidistant_lens_shows_angles() -> None:
    """The corners of the image look 65 degrees aside: r = f theta, and f tan(theta) without it."""
    lens = LENSES[2]
    corner = lens.origin + np.hypot(*SHAPE) / 2 * np.array([0.8, 0.6])
    radius = np.hypot(*(lens.undistort(corner) - lens.origin))
    assert radius == pytest.approx(lens.focal * np.tan(np.radians(65)))


@pytest.mark.parametrize('lens', LENSES, ids=str)
@pytest.mark.parametrize('make', [planes.board, planes.bars])
def test_truth_lies_on_the_edges(make, lens: Lens) -> None:
    """On an edge the grey level is the mean of those of its sides: within 0.1 px."""
    scene = make(lens)
    image, lines = planes.render(scene, lens), planes.lines(scene, lens)
    splines = spline_filter(image.astype(float), order=3, mode='nearest')
    offsets = np.concatenate([edge_offsets(splines, line) for line in lines])
    assert len(offsets) > 200
    assert np.abs(offsets).max() < 0.1
    assert np.abs(offsets.mean()) < 0.01


def edge_offsets(splines: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return how far (px) the edge is from a true line where its sides are flat, 5 px around."""
    step = np.gradient(line, axis=0)
    along = step / np.hypot(*step.T)[:, None]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    sides, clear = [], ((line > 5) & (line < np.array(SHAPE[::-1]) - 6)).all(axis=1)
    for side in (-4, 4):
        around = np.array([values(splines, line + side * across + 4 * u * along + v * across)
                           for u in (-1, 0, 1) for v in (-1, 0, 1)])
        sides.append(around.mean(axis=0))
        clear &= np.ptp(around, axis=0) < 1
    clear &= np.abs(sides[1] - sides[0]) > 60
    on, before, after = (values(splines, line + at * across) for at in (0, -0.5, 0.5))
    return ((on - (sides[0] + sides[1]) / 2) / (after - before))[clear]


def test_sagitta_is_the_distance_from_the_chord() -> None:
    """A bend 3 px off a chord of 8 px."""
    assert sagitta(np.array([[0, 0], [4, 3], [8, 0]], float)) == pytest.approx(3)
