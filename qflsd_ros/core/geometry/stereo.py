"""
Matches of the lines that two synchronised cameras of known relative pose see.

The plane of a line in the left camera and that of a line in the right one intersect in a line of
space, whatever the two are: a pair of lines, unlike a pair of points, has no epipolar constraint.
A pair is judged by the rest: the ends of both arcs, cut with the other plane, lie in front of both
cameras and cover the same part of the line; both travel along it in the same direction, with the
brighter side to the right; and both look alike.

A line in an epipolar plane, one that contains the baseline, meets all lines of that plane along
its whole length.  Its depth is not determined, and it is flagged instead of matched.

Reference: C. Schmid and A. Zisserman, The geometry and matching of lines and curves over multiple
views, IJCV 40(3), 2000, for the overlap by epipolar lines.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from qflsd_ros.core.geometry.lines import Lines
from qflsd_ros.core.geometry.planes import Planes
from qflsd_ros.core.geometry.triangulation import triangulate
from qflsd_ros.core.geometry.views import observed
from qflsd_ros.core.pose import Pose

# Sine of the angle between a plane and the baseline below which it counts as an epipolar plane: 6
# degrees, at which an error across of .1 px is one of 1 px along the baseline.  Chosen, not tuned.
EPIPOLAR = 0.1
# Least overlap of a pair.  Chosen, not tuned: a third is common where one arc is cut in half.
LEAST = 0.3
# Part of the score that the looks take, for each factor of e between them, and factors that count
# no further.  Chosen, not tuned.
LOOKS, FARTHEST = 0.5, 2.0
# Least difference of the score from the next best pair of the left line.  In the rendered room 98
# of 100 matches are right without it, 99.5 with .1, and 4 % of the matches are lost.
MARGIN = 0.1


class Sight(NamedTuple):
    """
    The lines that one camera of a pair sees.

    Attributes
    ----------
    planes
        N planes, in the camera's optical frame.
    contrasts
        (N,) float64 grey levels.

    """

    planes: Planes
    contrasts: np.ndarray


class Matches(NamedTuple):
    """
    Pairs of lines, in the order of the left ones.

    Attributes
    ----------
    left, right
        (K,) int64, the planes of each pair; none is in two pairs.
    lines
        K lines in the left camera's optical frame, from two views each; not all are determined.
    epipolar
        (N,) bool, left planes that contain the baseline: such lines are not matched.

    """

    left: np.ndarray
    right: np.ndarray
    lines: Lines
    epipolar: np.ndarray


def match(left: Sight, right: Sight, pose: Pose) -> Matches:
    """
    Match the lines of two cameras that were seen at the same time.

    Parameters
    ----------
    left, right
        The lines that both see.
    pose
        The pose of the right camera's optical frame in the left one's; its ``centre`` is the
        baseline.

    """
    epipolar = in_epipolar_planes(left.planes, pose.centre)
    overlap = overlaps(left.planes, right.planes, pose)
    ours, theirs = np.log(left.contrasts + 1), np.log(right.contrasts + 1)
    unlike = np.minimum(np.abs(ours[:, None] - theirs), FARTHEST)
    score = np.where(overlap >= LEAST, overlap - LOOKS * unlike, -np.inf)
    # A column of no match, so that there is a next best pair always.
    score = np.concatenate([score, np.full((len(score), 1), -np.inf)], axis=1)
    score[epipolar] = -np.inf
    if not score.size or score.shape[1] < 2:
        return _matches(left, right, pose, np.zeros((2, 0), np.int64), epipolar)
    best = score.argmax(axis=1)
    rows = np.arange(len(score))
    first = score[rows, best]
    others = score.copy()
    others[rows, best] = -np.inf
    with np.errstate(invalid='ignore'):
        clear = first - others.max(axis=1) >= MARGIN
    mutual = score.argmax(axis=0)[best] == rows
    chosen = np.flatnonzero(np.isfinite(first) & clear & mutual)
    return _matches(left, right, pose, np.stack([chosen, best[chosen]]), epipolar)


def _matches(left: Sight, right: Sight, pose: Pose, pairs: np.ndarray, epipolar: np.ndarray
             ) -> Matches:
    """Return the matches of pairs of planes, (2, K)."""
    here = Pose(np.eye(3), np.zeros(3))
    views = np.stack([observed(Planes(*(values[some] for values in sight.planes)), place)
                      for sight, some, place in zip((left, right), pairs, (here, pose))], axis=1)
    lines = triangulate(views, np.full(pairs.shape[1], 2))
    return Matches(pairs[0], pairs[1], lines, epipolar)


def in_epipolar_planes(planes: Planes, baseline: np.ndarray) -> np.ndarray:
    """Return which planes contain a baseline, (3,) in the camera's frame, or nearly: (N,) bool."""
    return np.abs(planes.normals @ baseline) < EPIPOLAR * np.linalg.norm(baseline)


def overlaps(left: Planes, right: Planes, pose: Pose) -> np.ndarray:
    """
    Return how much of the line of each pair of planes both arcs show.

    Returns
    -------
    overlaps
        (N, M) float64, 0 to 1: the common part of both arcs over their union, as angles in the
        left camera; 0 where the line is behind a camera or the arcs have opposite polarity.

    """
    normals, rays = right.normals @ pose.rotation.T, right.ends @ pose.rotation.T
    start, end = left.ends[:, 0], left.ends[:, 1]
    beside = np.cross(left.normals, start)
    with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
        # Distances along the left rays to the right plane, and along the right ones to the left.
        ours = (normals @ pose.centre)[:, None] / np.einsum('mi,nki->nmk', normals, left.ends)
        theirs = (-(left.normals @ pose.centre)[:, None, None]
                  / np.einsum('ni,mki->nmk', left.normals, rays))
        points = pose.centre + theirs[..., None] * rays
        angles = np.arctan2(np.einsum('nmki,ni->nmk', points, beside),
                            np.einsum('nmki,ni->nmk', points, start))
        length = np.arctan2((end * beside).sum(axis=1), (end * start).sum(axis=1))[:, None]
        first, last = angles[..., 0], angles[..., 1]
        common = np.minimum(last, length) - np.maximum(first, 0)
        union = np.maximum(last, length) - np.minimum(first, 0)
        front = (ours > 0).all(axis=2) & (theirs > 0).all(axis=2)
        return np.where(front & (last > first) & (common > 0), common / union, 0.0)
