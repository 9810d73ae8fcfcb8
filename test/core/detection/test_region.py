"""Masks: no arc leaves one, nothing that is masked counts, and all else is as without one."""
from __future__ import annotations

import cv2
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core import Detector, DivisionModel, Parameters
from qflsd_ros.core.detection.contours import noise, thresholds
from qflsd_ros.core.detection.region import MARGIN, region
from rendering import half_plane, off_line, render
from scenery import noise as texture
from scenery import scene
from soundness import assert_within

SHAPE = (180, 240)
Y, X = np.mgrid[:SHAPE[0], :SHAPE[1]]


def disk_mask(x: float, y: float, radius: float) -> np.ndarray:
    return np.hypot(X - x, Y - y) < radius


def blobs(seed: int, share: float = 0.3) -> np.ndarray:
    """Return a mask with holes of any shape, that leave out a share of all pixels."""
    gray = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, SHAPE), (0, 0), 6)
    return gray > np.quantile(gray, share)


MASKS = st.one_of(
    st.builds(disk_mask, st.floats(60, 180), st.floats(50, 130), st.floats(40, 110)),
    st.builds(lambda *disk: ~disk_mask(*disk), st.floats(0, 240), st.floats(0, 180),
              st.floats(5, 60)),
    st.builds(lambda x, y, angle: half_plane(x, y, angle)(X, Y) > 0, st.floats(80, 160),
              st.floats(60, 120), st.floats(-np.pi, np.pi)),
    st.builds(blobs, st.integers(0, 999)),
    st.builds(lambda pitch, width: (X + Y) % pitch >= width, st.integers(20, 60),
              st.integers(1, 4)))


@given(st.integers(0, 20), MASKS, st.sampled_from([0.7, 3.0]), st.sampled_from([None, -0.4]))
def test_no_arc_leaves_its_mask(seed, mask, tolerance, lam):
    gray = scene(seed)
    lens = None if lam is None else DivisionModel(lam, SHAPE)
    for parameters in (Parameters(tolerance=tolerance),
                       Parameters(tolerance=tolerance, min_score=-1000.0, contrast_low=1.0)):
        assert_within(Detector(parameters).detect(gray, mask, lens), mask)


@pytest.mark.parametrize('seed', range(4))
def test_arcs_come_as_close_to_their_mask_as_its_margin(seed):
    """A mask takes of an arc that crosses its rim no more than lies outside, and a little."""
    gray, mask = scene(seed), disk_mask(120, 90, 80)
    inner = cv2.erode(np.uint8(mask), np.ones((2 * MARGIN + 5, 2 * MARGIN + 5))) > 0
    usual, masked = (np.concatenate([np.zeros((0, 2), int), arcs.edge_pixels]) for arcs in (
        Detector().detect(gray), Detector().detect(gray, mask)))
    there = {tuple(pixel) for pixel in masked}
    wanted = [tuple(pixel) for pixel in usual if inner[pixel[1], pixel[0]]]
    assert len(wanted) > 100
    assert sum(pixel in there for pixel in wanted) > 0.9 * len(wanted)


@given(st.sampled_from([0.0, np.pi / 2, np.pi, 0.2, 1.2, 2.5]), st.floats(-0.5, 0.5),
       st.floats(MARGIN + 1.5, 6.0))
def test_edges_along_the_rim_are_as_exact_as_without_a_mask(angle, offset, inside):
    x, y = 119.5 - offset * np.sin(angle), 89.5 + offset * np.cos(angle)
    gray = render(SHAPE, half_plane(x, y, angle), blur=0.5)
    mask = half_plane(x, y, angle)(X, Y) > -inside
    row, = Detector().detect(gray, mask).table
    usual, = Detector().detect(gray).table
    assert row['length'] > 0.8 * usual['length']
    for place in ('start', 'middle', 'end'):
        assert abs(off_line(row[place], x, y, angle)) < 0.1


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize('there', [0, 255, 'noise', 'stripes'])
def test_what_is_masked_does_not_count(seed, there):
    gray = scene(seed).copy()
    gray[:, 114:] = 100
    gray[20:160, 108:] = 200        # an edge along the rim, others up to it
    mask = X < 120
    usual = Detector().detect(gray, mask)
    gray[:, 120:] = {'noise': texture(seed, (180, 120)), 'stripes': np.uint8(X[:, 120:] % 4 * 80)
                     }.get(there, there)
    other = Detector().detect(gray, mask)
    assert len(usual) > 3
    assert other.table.tobytes() == usual.table.tobytes()
    assert other.edge_points.tobytes() == usual.edge_points.tobytes()


@given(st.integers(0, 99), st.integers(0, 60), st.integers(0, 80), st.integers(60, 120),
       st.integers(80, 160), st.sampled_from([2.0, 8.0]))
def test_noise_and_contrast_in_a_region_are_those_of_its_picture(
        seed, top, left, height, width, sigma):
    errors = np.random.default_rng(seed).normal(0, sigma, SHAPE)
    gray = np.clip(scene(seed) + errors, 0, 255).astype(np.uint8)
    mask = np.zeros(SHAPE, bool)
    mask[top:top + height, left:left + width] = True
    where, part = region(SHAPE, mask), np.ascontiguousarray(gray[mask].reshape(height, width))
    assert noise.estimate(gray, where) == noise.estimate(part)
    assert thresholds.estimate(gray, where) == pytest.approx(thresholds.estimate(part), abs=0.15)


def test_a_mask_that_leaves_all_or_nothing():
    gray = scene()
    usual = Detector().detect(gray)
    for mask in (np.ones(SHAPE, bool), np.full(SHAPE, 7, np.uint8)):
        assert Detector().detect(gray, mask).table.tobytes() == usual.table.tobytes()
    for mask in (np.zeros(SHAPE, bool), X + Y == 90, X == 0, (X % 5 > 0) & (Y % 5 > 0)):
        assert len(Detector().detect(gray, mask)) == 0


def test_masks_of_any_kind_and_order_give_the_same():
    gray, mask = scene(), disk_mask(110, 80, 70)
    detector = Detector()
    usual, masked = Detector().detect(gray), Detector().detect(gray, mask)
    assert len(usual) > len(masked) > 1
    for form in (mask, None, np.uint8(mask) * 255, np.asfortranarray(mask), None,
                 np.repeat(mask, 2, axis=1)[:, ::2], ~~mask):
        expected = usual if form is None else masked
        assert detector.detect(gray, form).table.tobytes() == expected.table.tobytes()


@pytest.mark.parametrize('mask', [[[True]], 3, 'mask.png'])
def test_what_is_no_mask(mask):
    with pytest.raises(TypeError, match='mask is a .*: must be an array of shape .180, 240.'):
        Detector().detect(scene(), mask)
