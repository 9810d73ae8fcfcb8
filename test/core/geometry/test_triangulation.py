"""Lines from planes, against edges in space, repeated noise, and motions that show no depth."""
from __future__ import annotations

from pathlib import Path
import re

import numpy as np
from posed import edges, poses, sight, turned
import pytest
from qflsd_ros.core.geometry.lines import Lines
from qflsd_ros.core.geometry.triangulation import triangulate
from qflsd_ros.core.geometry.views import observed
from qflsd_ros.core.pose import Pose


def views(lines: np.ndarray, ways: list[Pose], noise: float = 0.0, flaw: float = 1e-9,
          seed: int | None = None) -> np.ndarray:
    """Return all views of edges by cameras: (N, K, VIEW)."""
    random = None if seed is None else np.random.default_rng(seed)
    seen = []
    for pose in ways:
        seen.append(observed(sight(lines, pose, noise, random), pose, flaw))
    return np.stack(seen, axis=1)


def solve(seen: np.ndarray) -> Lines:
    return triangulate(seen, np.full(len(seen), seen.shape[1]))


def errors(found: Lines, lines: np.ndarray) -> np.ndarray:
    """Return shifts and tilts of true edges from found lines, as their covariances count them."""
    along = lines[:, 1] - lines[:, 0]
    along /= (along * found.directions).sum(axis=1, keepdims=True)
    t = ((found.points - lines[:, 0]) * found.directions).sum(axis=1, keepdims=True)
    off = lines[:, 0] + t * along - found.points
    return np.concatenate([np.einsum('nki,ni->nk', found.across, off),
                           np.einsum('nki,ni->nk', found.across, along)], axis=1)


def spread(found: Lines, lines: np.ndarray) -> float:
    """Return errors over stated deviations, of all four degrees of freedom."""
    off = errors(found, lines)
    squares = np.einsum('ni,nij,nj->n', off, np.linalg.inv(found.covariances), off) / 4
    return float(np.sqrt(squares.mean()))


@pytest.mark.parametrize('count', [2, 3, 16])
def test_exact_views_give_the_edges(count):
    lines = edges(300)
    found = solve(views(lines, poses(count)))
    # Directions of travel are those of the edges, not only up to their sign.
    wanted = lines[:, 1] - lines[:, 0]
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    seen = found.determined
    assert seen.mean() > 0.9
    assert found.directions[seen] == pytest.approx(wanted[seen], abs=1e-6)
    assert found.ends[seen] == pytest.approx(lines[seen], abs=1e-6)
    assert (found.views[seen] == count).all()


def test_pluecker_coordinates_and_the_nearest_point():
    lines = edges(20)
    found = solve(views(lines, poses(4)))
    moments = np.cross(lines[:, 0], found.directions)
    assert found.moments == pytest.approx(moments, abs=1e-6)
    nearest = found.nearest(np.zeros(3))
    assert np.einsum('ni,ni->n', nearest, found.directions) == pytest.approx(0, abs=1e-9)
    assert np.cross(nearest, found.directions) == pytest.approx(moments, abs=1e-6)


@pytest.mark.parametrize('count', [2, 5, 16])
def test_errors_are_as_large_as_stated(count):
    lines, ways = edges(100), poses(count)
    ratios = []
    for seed in range(10):
        found = solve(views(lines, ways, 1e-3, seed=seed))
        good = found.parallaxes > 50    # the deviations are those of a linear approximation
        ratios.append(spread(found.chosen(good), lines[good]))
    assert 0.85 < np.mean(ratios) < 1.15


def test_covariances_of_points_along_a_line():
    lines, ways, ends = edges(100), poses(8), []
    for seed in range(40):
        found = solve(views(lines, ways, 1e-3, seed=seed))
        off = errors(found, lines)
        t = found.reaches
        across = off[:, None, :2] + t[..., None] * off[:, None, 2:]
        inverse = np.linalg.inv(found.covariances_at(t))
        ends.append(np.einsum('nsi,nsij,nsj->ns', across, inverse, across)[found.parallaxes > 50])
    assert 0.7 < np.mean(np.concatenate(ends)) / 2 < 1.4


def test_more_views_and_a_longer_way_are_more_exact():
    lines = edges(200)
    near, far, many = (np.median(np.abs(errors(
        solve(views(lines, poses(count, way=way), 1e-3, seed=1)), lines)[:, :2]))
        for count, way in ((4, (0.1, 0.1, 0.0)), (4, (0.6, 0.6, 0.0)), (16, (0.6, 0.6, 0.0))))
    assert many < far < near / 3


def test_weights_by_covariance_beat_equal_weights():
    """Half of the views are ten times as noisy, and say so."""
    lines, ways = edges(200), poses(12)
    weighted, equal = [], []
    for number, pose in enumerate(ways):
        noise = 2e-3 if number % 2 else 2e-4
        planes = sight(lines, pose, noise, np.random.default_rng(number))
        same = np.broadcast_to(np.eye(3) * 1e-6, planes.covariances.shape)
        weighted.append(observed(planes, pose, 0))
        equal.append(observed(planes._replace(covariances=same), pose, 0))
    one, other = (np.median(np.linalg.norm(errors(solve(np.stack(seen, axis=1)), lines), axis=1))
                  for seen in (weighted, equal))
    assert one < 0.4 * other


def along_the_way() -> tuple[np.ndarray, list[Pose]]:
    way = np.array([0.8, 0.1, 0.3])
    start = np.array([[-0.5, 0.4, 3], [0.6, -0.3, 2.5]])
    return np.stack([start, start + way], axis=1), [Pose(np.eye(3), s * way)
                                                    for s in np.linspace(0, 1, 8)]


def turning() -> tuple[np.ndarray, list[Pose]]:
    random = np.random.default_rng(3)
    return edges(30), [Pose(turned(random, 0.2), np.ones(3)) for _ in range(8)]


def in_the_plane() -> tuple[np.ndarray, list[Pose]]:
    """Return edges in the plane y = .5 z, in which the camera moves."""
    lines = np.array([[[-0.5, 1, 2], [0.3, 1.5, 3]], [[0.2, 1.2, 2.4], [0.9, 1.2, 2.4]]])
    return lines, [Pose(np.eye(3), np.array([s, 0.1 * s, 0.2 * s])) for s in np.linspace(0, 1, 8)]


@pytest.mark.parametrize('noise', [0.0, 1e-4, 1e-3])
@pytest.mark.parametrize('scene', [along_the_way, turning, in_the_plane])
def test_planes_that_coincide_determine_no_line(scene, noise):
    lines, ways = scene()
    for seed in range(20 if noise else 1):
        seen = views(lines, ways, noise, 1.5e-4, seed if noise else None)
        assert not solve(seen).determined.any()


def test_fewer_than_two_views_determine_no_line():
    seen = views(edges(3), poses(2))
    found = triangulate(seen, np.array([0, 1, 2]))
    assert found.determined.tolist() == [False, False, True]


@pytest.mark.parametrize('wrong', [1, 4])
def test_views_that_err_are_dropped_as_a_whole(wrong):
    lines, ways = edges(200), poses(12)
    seen = views(lines, ways, 1e-4, 1.5e-4, seed=0)
    other = views(edges(200, seed=9), ways, 1e-4, 1.5e-4, seed=1)
    random = np.random.default_rng(2)
    for row in range(200):
        chosen = random.choice(12, wrong, replace=False)
        seen[row, chosen] = other[row, chosen]
    found = solve(seen)
    right = solve(views(lines, ways, 1e-4, 1.5e-4, seed=0))
    both = found.determined & (right.parallaxes > 50)
    assert both.mean() > 0.85
    off, least = (np.linalg.norm(errors(one, lines)[:, :2], axis=1) for one in (found, right))
    assert np.mean(off[both] < 0.01 + 4 * least[both]) > 0.97
    assert np.median(found.views[both]) == 12 - wrong


def test_a_view_of_the_opposite_polarity_does_not_count():
    seen = views(edges(50), poses(6))
    seen[:, 2, :9] *= -1    # the normal and what is across it
    found = solve(seen)
    assert (found.views[found.determined] == 5).all()


def test_views_that_contradict_each_other_determine_no_line():
    seen = np.stack([views(edges(40, seed), poses(8))[:, seed] for seed in range(8)], axis=1)
    assert solve(seen).determined.mean() < 0.1


def test_opposite_polarity_turns_the_direction_round():
    lines = edges(50)
    there, back = (solve(views(way, poses(5))) for way in (lines, lines[:, ::-1]))
    assert back.directions == pytest.approx(-there.directions, abs=1e-6)
    assert back.ends == pytest.approx(there.ends[:, ::-1], abs=1e-6)


def test_the_order_of_the_views_does_not_matter():
    seen = views(edges(100), poses(10), 1e-3, seed=5)
    one, other = solve(seen), solve(seen[:, ::-1].copy())
    both = (one.parallaxes > 50)
    assert other.ends[both] == pytest.approx(one.ends[both], abs=1e-4)


@pytest.mark.parametrize('scale', [0.01, 1.0, 100.0])
def test_scale_and_motion_of_the_world_carry_over(scale):
    lines, ways = edges(100), poses(8)
    random = np.random.default_rng(7)
    turn, shift = turned(random, 1.0), np.array([3.0, -20, 8])
    moved = [Pose(turn @ pose.rotation, scale * turn @ pose.centre + shift) for pose in ways]
    plain = solve(views(lines, ways, 1e-3, seed=1))
    other = solve(views(scale * lines @ turn.T + shift, moved, 1e-3, seed=1))
    good = plain.parallaxes > 50
    assert other.ends[good] == pytest.approx(scale * plain.ends[good] @ turn.T + shift,
                                             abs=1e-5 * max(scale, 1))
    assert other.parallaxes[good] == pytest.approx(plain.parallaxes[good], rel=1e-4)
    sizes = np.linalg.eigvalsh(other.covariances[:, :2, :2])
    wanted = scale ** 2 * np.linalg.eigvalsh(plain.covariances[:, :2, :2])
    assert sizes[good] == pytest.approx(wanted[good], rel=1e-3)
    assert other.deviations[good] == pytest.approx(plain.deviations[good], rel=1e-3)


def test_ends_that_few_views_show_do_not_count():
    """One view of ten sees the edge twice as long; three see only its first half."""
    lines, ways = edges(60), poses(10)
    seen, middle = views(lines, ways), lines.mean(axis=1)
    longer = np.stack([2 * lines[:, 0] - middle, 2 * lines[:, 1] - middle], axis=1)
    seen[:, 4] = views(longer, ways)[:, 4]
    seen[:, 5:8] = views(np.stack([lines[:, 0], middle], axis=1), ways)[:, 5:8]
    found = solve(seen)
    assert found.ends[found.determined] == pytest.approx(lines[found.determined], abs=1e-6)


def test_a_wandering_edge_has_a_misfit():
    lines, ways = edges(50), poses(10)
    steady = solve(views(lines, ways, 1e-5, 1.5e-4, seed=0))
    planes = [sight(lines, pose, 3e-4, np.random.default_rng(k)) for k, pose in enumerate(ways)]
    wandering = solve(np.stack([
        observed(plane._replace(covariances=plane.covariances / 100), pose)
        for plane, pose in zip(planes, ways)], axis=1))
    assert np.median(steady.misfits) < 0.2
    assert np.median(wandering.misfits) > 1


def test_the_residual_of_the_documents_is_that_of_repeated_noise():
    text = (Path(__file__).parents[3] / 'doc' / 'messages.md').read_text()
    code = next(block for block in re.findall('```python\n(.*?)```', text, re.DOTALL)
                if 'def residual' in block)
    space: dict = {}
    exec(code, space)
    lines, pose = edges(2000), poses(3)[2]
    along = lines[:, 1] - lines[:, 0]
    for noise, deviation in ((0.0, 0.0), (1e-3, 1.0)):
        seen = sight(lines, pose, noise, np.random.default_rng(0) if noise else None)
        found = np.array([space['residual'](n, c, p, d, pose.rotation, pose.centre)
                          for n, c, p, d in zip(seen.normals, seen.covariances, lines[:, 0],
                                                along)])
        assert found.std(axis=0) == pytest.approx(deviation, abs=0.05)
        assert np.cov(found.T)[0, 1] == pytest.approx(0, abs=0.05)
