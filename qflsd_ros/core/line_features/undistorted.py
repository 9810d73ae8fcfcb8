"""
Arcs as straight lines of the undistorted image of a calibrated camera.

Normalised coordinates are those of the plane z = 1 of the optical frame: x right, y down.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.geometry.planes import Planes
from qflsd_ros.core.lens.camera_model import CameraModel

# Angle from the optical axis at which lines are cut: the undistorted image has no 90 degrees, and
# at 80 an error of a direction counts 33 times as much as on the axis.  Chosen, not tuned.
WIDEST = math.radians(80.0)
# Largest bend of the undistorted line, px at the centre: an edge that is bent more is not straight
# in space.  Systems that take lines expect errors of 1.5 px (PL-VIO, line_projection_factor).
STRAIGHT = 1.0


class Lines(NamedTuple):
    """
    N lines of the undistorted image, each from its start to its end.

    Attributes
    ----------
    arcs
        (N,) int64, the arc of each line.
    starts, ends
        (N, 2) float64, normalised.  Travel is that of the arc, with the brighter side right.
    std
        (N,) float64, normalised: standard deviation of the distance of the ends from the true
        line, the root mean square of both.
    lengths
        (N,) px in the image, of the part that is not cut off.

    """

    arcs: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    std: np.ndarray
    lengths: np.ndarray


def undistorted(arcs: Arcs, planes: Planes, camera: CameraModel) -> Lines:
    """
    Return the lines behind the arcs of one image.

    Left out are arcs without a plane, arcs of edges that are not straight, and what lies more than
    :data:`WIDEST` from the optical axis.

    Parameters
    ----------
    arcs, planes
        The arcs, and the planes that hold their edges.
    camera
        The calibrated camera that both are of.

    """
    table = arcs.table[planes.arcs]
    rays = camera.rays(np.stack([table['start'], table['middle'], table['end']], axis=1))
    off = np.einsum('nki,ni->nk', rays, planes.normals)
    bend = np.abs(off[:, 1] - (off[:, 0] + off[:, 2]) / 2) * camera.matrix[0, 0]
    first, across, turn = _within(rays, off, planes.normals)
    low, high = _in_sight(first, across, turn)
    with np.errstate(invalid='ignore'):
        kept = np.flatnonzero((high > low) & (bend <= STRAIGHT))
    ends = np.stack([_at(first[kept], across[kept], angle[kept]) for angle in (low, high)], axis=1)
    share = (high - low)[kept] / turn[kept]
    return Lines(planes.arcs[kept], ends[:, 0, :2], ends[:, 1, :2],
                 _deviations(ends, planes.normals[kept], planes.covariances[kept]),
                 table['length'][kept] * share)


def _within(rays: np.ndarray, off: np.ndarray, normals: np.ndarray
            ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return two orthogonal directions of each plane and the angle that its arc covers.

    The arc begins at the first direction and turns towards the second one.
    """
    ends = rays[:, ::2] - off[:, ::2, None] * normals[:, None]
    first = ends[:, 0] / np.linalg.norm(ends[:, 0], axis=1, keepdims=True)
    across = np.cross(normals, first)
    turn = np.arctan2((ends[:, 1] * across).sum(axis=1), (ends[:, 1] * first).sum(axis=1))
    return first, across, turn


def _in_sight(first: np.ndarray, across: np.ndarray, turn: np.ndarray
              ) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles of the part of each arc within WIDEST; the second is lower without any."""
    height, nearest = np.hypot(first[:, 2], across[:, 2]), np.arctan2(across[:, 2], first[:, 2])
    # Of the turns of the circle, that of the arc.
    nearest += 2 * np.pi * np.round((turn / 2 - nearest) / (2 * np.pi))
    with np.errstate(divide='ignore', invalid='ignore'):
        cosine = math.cos(WIDEST) / height
    reach = np.where(cosine < 1, np.arccos(np.minimum(cosine, 1)), -np.inf)
    return np.maximum(0, nearest - reach), np.minimum(turn, nearest + reach)


def _at(first: np.ndarray, across: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return the normalised points of planes at some angles, (N, 3) with z = 1."""
    points = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * across
    return points / points[:, 2:]


def _deviations(ends: np.ndarray, normals: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """
    Return the standard deviations across at the ends of lines, as in :attr:`Lines.std`.

    The distance of the point p from the line of the normal n is n p / |(n_x, n_y)|.
    """
    variances = np.einsum('nki,nij,nkj->nk', ends, covariances, ends)
    return np.sqrt(variances.mean(axis=1)) / np.hypot(*normals[:, :2].T)
