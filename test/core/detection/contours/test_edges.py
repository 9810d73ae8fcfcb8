"""Gradients, thinning, and the subpixel position of edges that are known exactly."""
from __future__ import annotations

from typing import NamedTuple

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from qflsd_ros.core.detection.contours import edges, gradients
from qflsd_ros.core.detection.frame import Frame
from qflsd_ros.core.detection.region import region
from rendering import disk, half_plane, off_circle, off_line, render

SHAPE = (60, 70)
MIDDLE = (34.5, 29.5)
angles = st.floats(-np.pi, np.pi)
pictures = arrays(np.uint8, st.tuples(st.integers(3, 20), st.integers(3, 20)))


class Found(NamedTuple):
    """What is found in an image of (H, W) pixels."""

    edges: np.ndarray       # (H, W) uint8
    around: np.ndarray      # (H, W) uint8; 0 in the outermost rows and columns
    magnitude: np.ndarray   # (H, W) float64, grey levels
    points: np.ndarray      # (E, 2) float64, px


def find(gray: np.ndarray, blur_sigma: float = 0.6, low: float = 5.0, high: float = 15.0,
         mask: np.ndarray | None = None) -> Found:
    """Return the edges of an image."""
    dx, dy = np.empty(gray.shape, np.int16), np.empty(gray.shape, np.int16)
    found, around = np.empty(gray.shape, np.uint8), np.zeros(gray.shape, np.uint8)
    width = gray.shape[1]
    rows = edges.Rows(np.empty((3, width), np.int32), np.empty(width, np.uint8))
    gradients.compute(gray, blur_sigma, dx, dy)
    frame = Frame(dx, dy, region(gray.shape, mask), 0.0, blur_sigma, low, high)
    count = edges.find(frame, rows, found, around)
    pixels = np.flatnonzero(found).astype(np.int32)
    assert count == len(pixels) or mask is not None and count > len(pixels)
    points = np.empty((4, len(pixels)), np.float32)
    edges.locate(dx.ravel(), dy.ravel(), width, pixels, len(pixels), points)
    return Found(found, around, np.hypot(dx, dy) / gradients.GAIN, points[:2].T.astype(float))


def shifted(angle: float, offset: float) -> tuple[float, float]:
    """Return the middle of the image, moved across a direction."""
    return MIDDLE[0] - offset * np.sin(angle), MIDDLE[1] + offset * np.cos(angle)


def interior(points: np.ndarray, margin: int = 5) -> np.ndarray:
    """Return the points away from the image's border, where the blur sees all there is."""
    size = np.array(SHAPE)[::-1]
    return points[((points > margin) & (points < size - 1 - margin)).all(axis=1)]


@given(angles, st.floats(-1, 1), st.sampled_from([0.0, 0.8, 1.2]))
def test_position_of_a_step(angle, offset, blur):
    line = *shifted(angle, offset), angle
    points = interior(find(render(SHAPE, half_plane(*line), 20, 230, blur)).points)
    off = off_line(points, *line)
    assert len(points) > 40
    assert np.abs(off).max() < 0.1
    assert abs(off.mean()) < 0.03


def test_position_is_not_biased():
    means = []
    for angle in np.radians(np.arange(0, 360, 7.5)):
        for offset in (-0.45, -0.2, 0.05, 0.3):
            line = *shifted(angle, offset), angle
            points = interior(find(render(SHAPE, half_plane(*line))).points)
            means.append(off_line(points, *line).mean())
    assert abs(np.mean(means)) < 0.003
    assert np.std(means) < 0.01


@pytest.mark.parametrize('blur', [0.0, 0.8])
@pytest.mark.parametrize('turned', [np.asarray, np.rot90])
def test_an_edge_that_runs_out_of_the_image_stays_straight(turned, blur):
    worst = []
    for angle in np.radians([5, 10, 20, 40, -5, -10, -20, -40]):
        x, y = 34.5, (2.0 if angle > 0 else 57.0)
        size = SHAPE[0] + 20, SHAPE[1] + 20
        larger = render(size, half_plane(x + 10, y + 10, angle), blur=blur)
        points = find(np.ascontiguousarray(turned(larger[10:-10, 10:-10]))).points
        if turned is np.rot90:
            points = np.c_[SHAPE[1] - 1 - points[:, 1], points[:, 0]]
        worst.append(np.abs(off_line(points, x, y, angle)).max())
    assert max(worst) < 0.5, worst


@given(st.floats(16, 23), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_position_of_a_circle(radius, x, y):
    circle = MIDDLE[0] + x, MIDDLE[1] + y, radius
    off = off_circle(find(render(SHAPE, disk(*circle), 20, 230)).points, *circle)
    assert np.abs(off).max() < 0.12
    # Blurring moves a bent edge inward, by about sigma^2 / (2 radius).
    assert -0.04 < off.mean() < 0.01


@given(angles, st.floats(-1, 1))
def test_inverted(angle, offset):
    gray = render(SHAPE, half_plane(*shifted(angle, offset), angle))
    assert np.array_equal(find(gray, 0.0).points, find(255 - gray, 0.0).points)
    one, other = interior(find(gray).points), interior(find(255 - gray).points)
    assert one.shape == other.shape and np.allclose(one, other, rtol=0, atol=0.02)


@pytest.mark.parametrize('turned', [np.asarray, np.transpose])
@pytest.mark.parametrize('height', [5, 40, 200])
def test_magnitude_is_the_step(turned, height):
    gray = np.zeros((20, 30), np.uint8)
    gray[:, 15:] = height
    magnitude = find(np.ascontiguousarray(turned(gray)), 0.0).magnitude
    assert magnitude.max() == height


def test_weak_and_strong():
    gray = np.zeros((30, 40), np.uint8)
    gray[:, 10:20], gray[:, 20:30], gray[:, 30:] = 10, 30, 34
    found = find(gray, 0.0, 5.0, 15.0).edges
    kinds = found & (edges.EDGE | edges.STRONG)
    assert set(kinds[1:-1, [9, 10]].flat) == {0, edges.EDGE}
    assert set(kinds[1:-1, [19, 20]].flat) == {0, edges.EDGE | edges.STRONG}
    assert not found[:, 25:].any()


@given(pictures, st.sampled_from([0.0, 0.6, 2.0]))
def test_edges_of_any_image(gray, blur_sigma):
    found, _, magnitude, points = find(gray, blur_sigma)
    is_edge, is_strong = (found & edges.EDGE) > 0, (found & edges.STRONG) > 0
    assert not found[~is_edge].any()
    assert not (found[[0, -1]].any() or found[:, [0, -1]].any())
    assert (magnitude[is_edge] >= 5).all()
    assert (is_strong == (is_edge & (magnitude >= 15))).all()
    pixels = np.argwhere(found)[:, ::-1]
    assert np.abs(points - pixels).max(initial=0) <= 1
    assert ((points != pixels).sum(axis=1) <= 2).all()


@given(st.integers(0, 255), st.sampled_from([0.0, 0.6, 5.0]))
def test_a_constant_image_has_none(level, blur_sigma):
    assert not find(np.full((9, 12), level, np.uint8), blur_sigma).edges.any()


@given(angles)
def test_an_edge_is_thin(angle):
    found = find(render(SHAPE, half_plane(*MIDDLE, angle))).edges > 0
    inner = found[5:-5, 5:-5]
    # Along the axis that it runs along, more or less, at most two pixels of it side by side.
    across = 0 if abs(np.cos(angle)) >= abs(np.sin(angle)) else 1
    assert set(inner.sum(axis=across).tolist()) <= {0, 1, 2}


def test_blur_removes_detail():
    gray = np.random.default_rng(0).integers(100, 156, (80, 80), np.uint8)
    strength = [find(gray, blur_sigma).magnitude.mean() for blur_sigma in (0.0, 0.6, 1.5)]
    assert strength[0] > 1.2 * strength[1] > 1.2 * 1.2 * strength[2]


@given(pictures)
def test_neighbours_of_any_edge_map(gray):
    found, around, _, _ = find(gray)
    for y, x in np.ndindex(gray.shape[0] - 2, gray.shape[1] - 2):
        neighbours = [found[y + 1 + step_y, x + 1 + step_x] > 0 for step_x, step_y in edges.STEPS]
        assert around[y + 1, x + 1] == sum(1 << i for i in range(8) if neighbours[i])


def test_masked_pixels_are_no_edge_pixels():
    gray = np.zeros((30, 40), np.uint8)
    gray[:, 20:] = 100
    mask = np.ones(gray.shape, np.uint8)
    mask[:15] = 0
    found, around, _, _ = find(gray, mask=mask)
    first = np.flatnonzero(found.any(axis=1))[0]
    assert first > 15
    assert np.array_equal(found[first:], find(gray).edges[first:])
    assert not around[:first - 1].any()
