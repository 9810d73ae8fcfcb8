"""The room seen by a camera that walks through it, and the parts of its edges that it sees."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from qflsd_ros.core import Tracker
from qflsd_ros.core.geometry.planes import Planes, planes
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.pose import Pose
from qflsd_ros.sources.scene import Scene
from qflsd_ros.sources.scene.optics import calibration

BINS = 200          # parts of an edge
CONTRAST = 10.0     # grey levels, of edges that can be found: five times the noise
EVERY = 10          # frames between two in which edges are looked at
NEAR = 2.0          # px within which an arc lies on the image of an edge
MOST = 0.7          # share of the frames in which it does, for a track to be that of the edge
EXACT = 2e-5        # radians: rays of arcs that are exact, by a model of CameraInfo


class Seen(NamedTuple):
    """What the detector sees in a posed image: the track of each plane."""

    tracks: np.ndarray
    planes: Planes
    pose: Pose


class Walk:
    """
    The room in motion.

    Attributes
    ----------
    edges
        (E, 2, 3) m, the true edges.
    focal
        Focal length at the centre, px.

    """

    def __init__(self, lam: float, noise: float, shape: tuple[int, int]) -> None:
        height, width = shape
        self._scene = Scene(width, height, lam, noise)
        terms = calibration(self._scene.lens)
        self._camera = CameraModel(terms.distortion_model, terms.matrix, terms.coefficients)
        self.edges, self.focal = self._scene.edges, float(terms.matrix[0, 0])

    def see(self, frames: range, shift: np.ndarray | None = None) -> list[Seen]:
        """Return what is seen in frames, by a camera beside the usual one by ``shift``, m."""
        tracker, found = Tracker(), []
        for number in frames:
            arcs = tracker.track(self._scene.image(number), lens=self._scene.lens)
            seen = planes(arcs, self._camera)
            found.append(Seen(arcs.table['track'][seen.arcs].astype(np.int64), seen,
                              Pose.from_matrix(self._scene.pose(number))))
        return found

    def visible(self, frames: range) -> np.ndarray:
        """Return in how many frames each part of each edge shows contrast: (E, BINS) int."""
        counts = np.zeros((len(self.edges), BINS), int)
        for number in frames:
            arcs = self._scene.truth(number)
            arcs.table['contrast'][:] = np.nan_to_num(arcs.table['contrast'])
            table = arcs.table[arcs.table['contrast'] >= CONTRAST]
            rays = np.stack([self._camera.rays(table[end]) for end in ('start', 'end')], axis=1)
            edge, shares = _on_edges(self.edges, Pose.from_matrix(self._scene.pose(number)), rays)
            for i, row in zip(edge, np.sort(shares, axis=1) * BINS):
                if i >= 0:
                    counts[i, int(np.ceil(row[0] - 1e-6)):int(row[1] + 1e-6)] += 1
        return counts

    def depicted(self, seen: list[Seen]) -> dict[int, int]:
        """Return the edge that a track shows in most frames, for tracks that show one."""
        frames: dict[int, int] = {}
        votes: dict[int, dict[int, list[float]]] = {}
        for one in seen:
            off, inside = _distances(self.edges, one.pose, one.planes.ends)
            for k, track in enumerate(one.tracks.tolist()):
                frames[track] = frames.get(track, 0) + 1
                for edge in np.flatnonzero((off[k] < NEAR / self.focal) & inside[k]):
                    votes.setdefault(track, {}).setdefault(int(edge), []).append(off[k, edge])
        result = {}
        for track, edges in votes.items():
            often = [(float(np.median(off)), edge) for edge, off in edges.items()
                     if len(off) >= MOST * frames[track]]
            if often:
                result[track] = min(often)[1]
        return result


def _distances(edges: np.ndarray, pose: Pose, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far rays, (N, 2, 3), are from planes of edges, and whether their middles meet."""
    local = (edges - pose.centre) @ pose.rotation
    start, along = local[:, 0], local[:, 1] - local[:, 0]
    normals = np.cross(start, along)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    off = np.abs(np.einsum('nki,ei->nke', ends, normals)).max(axis=1)
    middle = ends.sum(axis=1)
    share, depth = _meet(start, along, normals, middle)
    return off, (share > -0.02) & (share < 1.02) & (depth > 0)


def _meet(start: np.ndarray, along: np.ndarray, normals: np.ndarray, rays: np.ndarray
          ) -> tuple[np.ndarray, np.ndarray]:
    """Return at which share of each edge each ray meets it, and whether in front: (N, E)."""
    with np.errstate(divide='ignore', invalid='ignore'):
        share = -(np.einsum('nj,ej->ne', rays, np.cross(normals, start))
                  / np.einsum('nj,ej->ne', rays, np.cross(normals, along)))
        points = start + share[..., None] * along
    return share, np.einsum('nei,ni->ne', points, rays)


def _on_edges(edges: np.ndarray, pose: Pose, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the edge of each exact arc, (N,), -1 for none, and the shares of its ends, (N, 2)."""
    local = (edges - pose.centre) @ pose.rotation
    start, along = local[:, 0], local[:, 1] - local[:, 0]
    normals = np.cross(start, along)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    off = np.abs(np.einsum('nki,ei->nke', rays, normals)).max(axis=1)
    shares = np.stack([_meet(start, along, normals, rays[:, k])[0] for k in (0, 1)], axis=-1)
    depth = _meet(start, along, normals, rays.sum(axis=1))[1]
    good = (off < EXACT) & (depth > 0) & ((shares > -1e-3) & (shares < 1.001)).all(axis=-1)
    edge = np.where(good.any(axis=1), good.argmax(axis=1), -1)
    return edge, shares[np.arange(len(rays)), edge]
