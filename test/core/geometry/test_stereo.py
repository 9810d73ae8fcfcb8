"""Matches of lines between two cameras: simulated edges, and the rendered room."""
from __future__ import annotations

import numpy as np
from posed import edges, sight
import pytest
from qflsd_ros.core.geometry.planes import Planes
from qflsd_ros.core.geometry.stereo import in_epipolar_planes, match, Matches, overlaps, Sight
from qflsd_ros.core.pose import Pose

HERE = Pose(np.eye(3), np.zeros(3))
BESIDE = Pose.from_quaternion(np.array([0.02, -0.05, 0.01, 1]), np.array([0.2, 0.01, -0.02]))
CONTRASTS = np.random.default_rng(5).uniform(15, 120, 60)


def see(lines: np.ndarray, pose: Pose, noise: float = 1e-4, seed: int = 0) -> Planes:
    return sight(lines, pose, noise, np.random.default_rng(seed))


def matched(lines: np.ndarray, order: np.ndarray) -> Matches:
    """Match what two cameras see, the right one in another order."""
    left = Sight(see(lines, HERE), CONTRASTS[:len(lines)])
    right = Sight(see(lines[order], BESIDE, seed=1), 1.05 * CONTRASTS[order])
    return match(left, right, BESIDE)


def test_edges_are_matched_and_triangulated():
    lines = edges(60)
    order = np.random.default_rng(2).permutation(60)
    found = matched(lines, order)
    assert np.mean(order[found.right] == found.left) > 0.97
    assert len(found.left) > 0.85 * (~found.epipolar).sum()
    right = (order[found.right] == found.left) & found.lines.determined
    off = np.linalg.norm(found.lines.ends - lines[found.left], axis=2)[right]
    assert np.median(off) < 0.03


def test_no_line_is_in_two_pairs():
    found = matched(edges(60), np.arange(60))
    assert len(set(found.left.tolist())) == len(set(found.right.tolist())) == len(found.left)


def test_lines_in_epipolar_planes_are_flagged_and_not_matched():
    baseline = BESIDE.centre
    starts = np.array([[[-0.5, y, 3.0]] for y in (-1, 0.3, 0.8)])
    along = starts + np.array([[0.0], [5]]) * baseline
    lines = np.concatenate([along, edges(20)])
    found = matched(lines, np.arange(23))
    assert found.epipolar[:3].all() and found.epipolar.mean() < 0.5
    assert not np.isin(found.left, np.flatnonzero(found.epipolar)).any()
    assert in_epipolar_planes(see(lines, HERE), baseline).tolist() == found.epipolar.tolist()


def test_opposite_polarity_does_not_match():
    lines = edges(30)
    left, right = see(lines, HERE), see(lines[:, ::-1], BESIDE)
    assert (np.diag(overlaps(left, right, BESIDE)) == 0).all()
    assert np.diag(overlaps(left, see(lines, BESIDE), BESIDE)).min() > 0.9


def test_overlap_is_the_common_part_over_the_union():
    lines = np.array([[[-0.3, -1.0, 3], [0.2, 1, 3.2]]])
    half = np.stack([lines[:, 0], lines.mean(axis=1)], axis=1)
    value, = overlaps(see(lines, HERE, 0), see(half, BESIDE, 0), BESIDE)[0]
    whole = np.arccos(np.dot(*(lines[0] / np.linalg.norm(lines[0], axis=1)[:, None])))
    part = np.arccos(np.dot(*(half[0] / np.linalg.norm(half[0], axis=1)[:, None])))
    assert value == pytest.approx(part / whole, abs=0.01)


def test_parallel_edges_that_look_alike_are_left_out():
    """Two of three equal bars cannot be told apart; a third one differs in contrast."""
    bars = np.array([[[x, -0.5, 3.0], [x, 0.5, 3]] for x in (-0.05, 0.0, 0.05)])
    left = Sight(see(bars, HERE), np.array([40.0, 40, 90]))
    right = Sight(see(bars, BESIDE, seed=1), np.array([40.0, 40, 90]))
    found = match(left, right, BESIDE)
    assert found.left.tolist() == found.right.tolist() == [2]


def test_edges_behind_a_camera_do_not_match():
    lines = edges(20)
    behind = lines * (1, 1, -1)
    assert (np.diag(overlaps(see(lines, HERE), see(behind, BESIDE), BESIDE)) == 0).all()


@pytest.mark.parametrize('counts', [(0, 0), (0, 5), (5, 0), (1, 1)])
def test_few_or_no_lines(counts):
    left, right = (Sight(see(edges(9)[:count], pose), CONTRASTS[:count])
                   for count, pose in zip(counts, (HERE, BESIDE)))
    found = match(left, right, BESIDE)
    assert len(found.left) == min(counts) and len(found.epipolar) == counts[0]
