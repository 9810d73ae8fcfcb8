"""Chains: each pixel once, linked to the next, the same however an image is turned."""
from __future__ import annotations

import cv2
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from qflsd_ros.core.detection.contours import chains, edges, gradients
from qflsd_ros.core.detection.contours.edges import STRONG, VISITED
from qflsd_ros.core.detection.frame import Frame
from qflsd_ros.core.detection.region import region

LOW, HIGH = 4.0, 10.0       # grey levels
images = arrays(np.uint8, st.tuples(st.integers(5, 25), st.integers(5, 25)),
                elements=st.integers(0, 255))
Chains = list[np.ndarray]


def find(gray: np.ndarray, min_points: int = 1) -> tuple[Chains, np.ndarray, np.ndarray]:
    """Return the chains of an image, each (n, 2) of x and y, its edge map and its gradients."""
    dx, dy = np.empty(gray.shape, np.int16), np.empty(gray.shape, np.int16)
    gradients.compute(gray, 0.7, dx, dy)
    flat = np.zeros((gray.size + 7) // 8 * 8, np.uint8)
    width = gray.shape[1]
    edge_map, around = flat[:gray.size].reshape(gray.shape), np.empty(gray.shape, np.uint8)
    rows = edges.Rows(np.empty((3, width), np.int32), np.empty(width, np.uint8))
    frame = Frame(dx, dy, region(gray.shape, None), 0.0, 0.7, LOW, HIGH)
    size = max(1, edges.find(frame, rows, edge_map, around))
    before = edge_map.copy()
    pixels, offsets = np.empty(size, np.int32), np.empty(size // min_points + 2, np.int64)
    count = chains.trace(chains.edge_map(flat, around, dx, dy), flat.view(np.uint64), min_points,
                         pixels, offsets)
    assert not (flat & STRONG).any()
    found = [np.column_stack([pixels[a:b] % width, pixels[a:b] // width])
             for a, b in zip(offsets[:count], offsets[1:count + 1])]
    visited = {(x, y) for y, x in np.argwhere(edge_map & VISITED)}
    assert visited >= {tuple(pixel) for chain in found for pixel in chain}
    return found, before, np.stack([dx, dy])


def photograph(seed: int, height: int = 60, width: int = 80) -> np.ndarray:
    """Return an image of some bright and dark polygons, blurred, with noise."""
    random = np.random.default_rng(seed)
    gray = np.full((height, width), 120.0)
    for _ in range(6):
        corners = random.uniform(0, (width, height), (3, 2)).astype(np.int32)
        cv2.fillConvexPoly(gray, cv2.convexHull(corners), float(random.integers(20, 230)))
    gray = cv2.GaussianBlur(gray, (0, 0), 0.8) + random.normal(0, 2, gray.shape)
    return gray.clip(0, 255).astype(np.uint8)


@given(images, st.sampled_from([1, 3, 8]))
def test_chains_of_any_image(gray, min_points):
    found, edge_map, slopes = find(gray, min_points)
    for chain in found:
        assert len(chain) >= min_points
        assert edge_map[chain[:, 1], chain[:, 0]].all()
        assert (edge_map[chain[:, 1], chain[:, 0]] & STRONG).any()
        assert np.abs(np.diff(chain, axis=0)).max(axis=1, initial=0).max(initial=0) <= 2
    pixels = [tuple(pixel) for chain in found for pixel in chain]
    assert len(pixels) == len(set(pixels))
    if min_points == 1:
        assert {(x, y) for y, x in np.argwhere(edge_map & STRONG)} <= set(pixels)


@given(images)
def test_the_brighter_side_is_on_the_right(gray):
    found, _, slopes = find(gray)
    for chain in found:
        gx, gy = slopes[:, chain[:, 1], chain[:, 0]].astype(float)
        # Links agree with the sum of both gradients, which differ by 50 degrees at most.
        assert (gx[1:] * gx[:-1] + gy[1:] * gy[:-1] > 0).all()


def as_sets(found: Chains) -> set[frozenset[tuple[int, int]]]:
    """Return chains as sets of pixels."""
    return {frozenset(map(tuple, chain.tolist())) for chain in found}


@pytest.mark.parametrize('seed', range(8))
@pytest.mark.parametrize('turn', ['transposed', 'mirrored', 'upside down', 'inverted'])
def test_chains_do_not_depend_on_the_order_of_reading(seed, turn):
    gray = photograph(seed)
    height, width = gray.shape
    other, back = {
        'transposed': (gray.T, lambda x, y: (y, x)),
        'mirrored': (gray[:, ::-1], lambda x, y: (width - 1 - x, y)),
        'upside down': (gray[::-1, ::-1], lambda x, y: (width - 1 - x, height - 1 - y)),
        'inverted': (255 - gray, lambda x, y: (x, y))}[turn]
    one = as_sets(find(gray)[0])
    two = {frozenset(back(x, y) for x, y in chain)
           for chain in as_sets(find(np.ascontiguousarray(other))[0])}
    # Ties of the magnitude may still put a pixel to one side of an edge or to the other.
    share = sum(len(chain) for chain in one & two) / sum(map(len, one))
    assert share > 0.7


def test_inverting_turns_chains_round():
    gray = np.full((30, 60), 50, np.uint8)
    gray[15:] = 200
    (one,), (two,) = find(gray)[0], find(255 - gray)[0]
    assert np.array_equal(one, two[::-1])
    assert one[0, 0] < one[-1, 0]       # the brighter side is below: right of travel along x


@given(st.integers(8, 25), st.floats(0, 2 * np.pi))
def test_a_disc_is_one_chain(radius, phase):
    y, x = np.indices((60, 80)) - np.array([30 + np.sin(phase), 40 + np.cos(phase)])[:, None, None]
    gray = (50 + 150 / (1 + np.exp((np.hypot(x, y) - radius) / 0.4))).astype(np.uint8)
    found, edge_map, _ = find(gray)
    chain = max(found, key=len)
    assert len(chain) > 0.95 * np.count_nonzero(edge_map)
    assert np.abs(chain[0] - chain[-1]).max() <= 2


def test_weak_edges_go_on_but_do_not_begin():
    y, x = np.indices((40, 60))
    # Weak above and below, but for one place above.
    height = 7 + 8 * np.exp(-((x - 30) / 6) ** 2) * np.clip((26 - y) / 14, 0, 1)
    found, _, _ = find(np.uint8(100 + np.where((y >= 10) & (y < 30), height, 0)))
    rows = {int(row) for chain in found for row in chain[:, 1]}
    assert rows and max(rows) < 20
    assert max(np.ptp(chain[:, 0]) for chain in found) > 20


def test_short_chains_are_left_out():
    gray = photograph(1)
    lengths = [len(chain) for chain in find(gray)[0]]
    assert [len(chain) for chain in find(gray, 8)[0]] == [n for n in lengths if n >= 8]
    assert any(n < 8 for n in lengths)


def test_nothing():
    assert find(np.full((9, 9), 80, np.uint8))[0] == []
