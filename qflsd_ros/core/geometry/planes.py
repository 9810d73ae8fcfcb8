"""
The planes through the optical centre that hold the straight edges behind arcs.

The viewing directions of the points of an arc lie in one plane if the edge is straight.  One image
determines the normal of that plane, and nothing else about the edge.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.lens.camera_model import CameraModel

SAMPLES = 9     # points along an arc; chosen, not tuned
STEP = 1e-3     # px across, for the derivative of a ray


class Planes(NamedTuple):
    """
    Planes through the optical centre.

    Attributes
    ----------
    arcs
        (N,) int64, the arc of each plane; arcs that leave the lens's model have none.
    normals
        (N, 3) float64 of length 1, in the optical frame (x right, y down, z forward), towards the
        brighter side of the edge.
    covariances
        (N, 3, 3) float64 of the normals, from offset_std and curvature_std of the arcs; of rank 2
        at most, as a normal does not change its length.
    ends
        (N, 2, 3) float64 unit vectors, the rays of start and end of each arc, in the optical
        frame.

    """

    arcs: np.ndarray
    normals: np.ndarray
    covariances: np.ndarray
    ends: np.ndarray


def planes(arcs: Arcs, camera: CameraModel) -> Planes:
    """Return the planes that hold the edges of one image."""
    points, across = _samples(arcs)
    rays = camera.rays(points)
    moved = camera.rays(points + STEP * across)
    known = np.flatnonzero(np.isfinite(rays + moved).all(axis=(1, 2)))
    rays, change = rays[known], (moved[known] - rays[known]) / STEP
    values, axes = np.linalg.eigh(np.einsum('nki,nkj->nij', rays, rays))
    normals = axes[:, :, 0]
    wanted = np.cross(rays[:, 0], rays[:, -1])
    normals = normals * np.where(np.einsum('ni,ni->n', wanted, normals) < 0, -1, 1)[:, None]
    # Least squares: if the rays change by d along the normal n, that changes by -S^-1 sum(r d),
    # S = sum(r r'), inverted within the plane.
    inverse = np.einsum('nik,nk,njk->nij', axes[:, :, 1:], 1 / values[:, 1:], axes[:, :, 1:])
    depth = np.einsum('nki,ni->nk', change, normals)
    slope = np.einsum('nij,nkj,nk,nkm->nim', inverse, rays, depth, _shapes(arcs.table[known]))
    return Planes(known, normals, np.einsum('nim,njm->nij', slope, slope), rays[:, [0, -1]])


def _samples(arcs: Arcs) -> tuple[np.ndarray, np.ndarray]:
    """Return points along arcs and the unit vectors across, towards the right: (M, S, 2) each."""
    points = arcs.samples(SAMPLES)
    table, share = arcs.table, np.linspace(-0.5, 0.5, SAMPLES)
    chord = table['end'] - table['start']
    angle = np.arctan2(chord[:, 1], chord[:, 0])[:, None] \
        + (table['curvature'] * table['length'])[:, None] * share
    return points, np.stack([-np.sin(angle), np.cos(angle)], axis=-1)


def _shapes(table: np.ndarray) -> np.ndarray:
    """
    Return deviations of arcs across, at points along them: (M, S, 3) px, one standard deviation.

    The three are shift, turn and bend.  They are independent for points spread evenly over a
    length, here that of the fitted points, which ends before corners.  If the mean of the points
    has the variance u, a fitted curvature has the variance 720 u / length^4, and the middle of the
    arc 9 u / 4.  Where the curvature was not fitted, the middle has the variance u.  There the
    curvature follows from the lens, without error of its own; or, without a lens, it is 0 because
    the fitted one did not differ from 0 significantly, and has the variance of that.  Where u is
    0, the points are taken to be spread over the whole arc.
    """
    bent, std = table['bent'] == 1, table['curvature_std']
    shift = np.where(bent, 2 / 3, 1) * table['offset_std']
    length = table['length'].copy()
    np.sqrt(np.divide(np.sqrt(720) * shift, std, where=(std > 0) & (shift > 0), out=length ** 2),
            out=length)
    along = table['length'][:, None] * np.linspace(-0.5, 0.5, SAMPLES)
    turn = (shift * np.sqrt(12) / length)[:, None] * along
    by_lens = ~bent & (table['curvature'] != 0)
    bend = np.where(by_lens, 0, std)[:, None] * (along ** 2 / 2 - length[:, None] ** 2 / 24)
    return np.stack([np.broadcast_to(shift[:, None], along.shape), turn, bend], axis=-1)
