"""What holds for every arc of every image."""
from __future__ import annotations

from finding import project, samples
import numpy as np
from qflsd_ros.core import Arcs, Parameters
from qflsd_ros.core.detection import extension
from qflsd_ros.core.detection.contours import edges, gradients, noise, thresholds

ACROSS = 0.5        # least cosine of the angle between a gradient and what counts as across
EPSILON = 1e-3      # grey levels, of rounding
STEP = 0.5          # px at most between the points of an arc that are held against a mask
WIDE = 3.0          # px of tolerance, within which an edge may turn back beyond the arc's end


def assert_sound(arcs: Arcs, gray: np.ndarray, parameters: Parameters = Parameters()) -> None:
    """Assert what holds for every arc of every image."""
    height, width = gray.shape
    table = arcs.table
    for name in table.dtype.names:
        assert np.isfinite(table[name]).all(), name
    for name in ('start', 'middle', 'end'):
        assert (table[name] >= -0.5).all(), name
        assert (table[name] <= (width - 0.5, height - 0.5)).all(), name
    assert (table['length'] >= parameters.min_length).all()
    sharpest = 2 / (parameters.min_radius * np.hypot(height, width))
    assert (np.abs(table['curvature']) <= sharpest * (1 + 1e-12)).all()
    assert (table['rms'] <= parameters.tolerance).all()
    assert (table['score'] >= parameters.min_score).all()
    assert (table['contrast'] > 0).all()
    assert ((table['polarity'] >= 0) & (table['polarity'] <= 1)).all()
    assert (table['curvature_std'] > 0).all() and (table['offset_std'] > 0).all()
    assert table['support'].tolist() == [len(arcs.pixels(i)) for i in range(len(arcs))]
    assert arcs.offsets[0] == 0 and arcs.offsets[-1] == len(arcs.edge_pixels)
    assert len({tuple(pixel) for pixel in arcs.edge_pixels}) == len(arcs.edge_pixels)
    assert np.abs(arcs.edge_points - arcs.edge_pixels).max(initial=0) <= 1
    assert_edge_pixels(arcs.edge_pixels, gray, parameters)
    for i in range(len(arcs)):
        assert_one_circle(table[i])
        assert_along(samples(arcs, i), arcs.points(i), parameters)


def assert_edge_pixels(pixels: np.ndarray, gray: np.ndarray, parameters: Parameters) -> None:
    """Assert that each pixel's step is the largest across the edge, and high enough."""
    grain = noise.estimate(gray)
    sigma = noise.blur(parameters.blur_sigma, grain)
    low = parameters.contrast_low * thresholds.scale(
        thresholds.estimate(gray), noise.of_gradient(grain, sigma), parameters.contrast_high)
    dx, dy = (np.empty(gray.shape, np.int16) for _ in range(2))
    gradients.compute(gray, sigma, dx, dy)
    dx, dy = dx / gradients.GAIN, dy / edges.GAIN
    magnitude = np.pad(np.hypot(dx, dy), 1)
    x, y = pixels.T
    here = magnitude[y + 1, x + 1]
    assert (here >= low - EPSILON).all()
    largest = np.zeros(len(pixels), bool)
    for u, v in ((1, 0), (1, 1), (0, 1), (-1, 1)):
        beside = np.maximum(magnitude[y + 1 + v, x + 1 + u], magnitude[y + 1 - v, x + 1 - u])
        across = abs(u * dx[y, x] + v * dy[y, x]) >= ACROSS * np.hypot(u, v) * here
        largest |= across & (here >= beside - EPSILON)
    assert largest.all()


def assert_one_circle(row: np.void) -> None:
    """Assert that start, middle, end, curvature and length tell of the same arc."""
    a, b, c = row['middle'] - row['start'], row['end'] - row['middle'], row['end'] - row['start']
    sizes = np.hypot(*np.array([a, b, c]).T)
    assert np.isclose(sizes[0], sizes[1], rtol=0, atol=1e-6)
    curvature = 2 * (a[0] * b[1] - a[1] * b[0]) / sizes.prod()
    assert np.isclose(row['curvature'], curvature, rtol=1e-6, atol=1e-9)
    half = row['curvature'] * row['length'] / 2
    assert abs(half) <= np.pi / 2 + 1e-6
    assert np.isclose(sizes[2], row['length'] * np.sinc(half / np.pi), rtol=1e-6)


def assert_along(line: np.ndarray, points: np.ndarray, parameters: Parameters) -> None:
    """Assert that edge points lie along an arc in order, from its start to its end."""
    if parameters.tolerance > WIDE:
        return
    off, place = project(points, line)
    assert off.max() < 4 * parameters.tolerance
    assert np.diff(place).min(initial=0) > -6
    ends = 4 + extension.FARTHEST
    assert place[0] < ends and place[-1] > project(line[-1:], line)[1] - ends


def assert_within(arcs: Arcs, mask: np.ndarray) -> None:
    """Assert that no point of an arc lies on a masked pixel."""
    last = np.array(mask.shape)[::-1] - 1
    for i, length in enumerate(arcs.table['length']):
        points = samples(arcs, i, int(np.ceil(length / STEP)) + 1)
        x, y = np.clip(np.floor(points + 0.5), 0, last).astype(int).T
        assert mask[y, x].all(), arcs.table[i]
    assert mask[arcs.edge_pixels[:, 1], arcs.edge_pixels[:, 0]].all()
