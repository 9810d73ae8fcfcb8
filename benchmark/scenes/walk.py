"""The room seen by a camera that walks through it, and the parts of its edges that it sees."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from qflsd_ros.core import Arcs, AttitudeTracker, Tracker
from qflsd_ros.core.geometry.planes import Planes, planes
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.conversion import calibration_terms, CameraInfoTerms
from qflsd_ros.core.lens.tracker import LensTracker
from qflsd_ros.core.pose import Pose
from qflsd_ros.sources.scene import Scene
from qflsd_ros.sources.scene.optics import calibration, Camera
from qflsd_ros.sources.scene.room import furnish

BINS = 200          # parts of an edge
CONTRAST = 10.0     # grey levels, of edges that can be found: five times the noise
EVERY = 10          # frames between two in which edges are looked at
NEAR = 2.0          # px within which an arc lies on the image of an edge
MOST = 0.7          # share of the frames in which it does, for a track to be that of the edge
EXACT = 2e-5        # radians: rays of arcs that are exact, by a model of CameraInfo


class Seen(NamedTuple):
    """What the detector sees in a posed image: track and contrast of each plane."""

    tracks: np.ndarray
    contrasts: np.ndarray
    planes: Planes
    pose: Pose

    @classmethod
    def of(cls, arcs: Arcs, camera: CameraModel, matrix: np.ndarray) -> Seen:
        """Return what tracked arcs show to a camera with a pose, (4, 4)."""
        found = planes(arcs, camera)
        rows = arcs.table[found.arcs]
        return cls(rows['track'].astype(np.int64), rows['contrast'].copy(), found,
                   Pose.from_matrix(matrix))


class Beside(Scene):
    """The room, seen from beside the usual path: ``shift``, (3,) m, is along the image's axes."""

    shift = np.zeros(3)

    def _camera(self, number: int) -> Camera:
        usual = super()._camera(number)
        return Camera(usual.lens, usual.position + self.shift @ usual.axes, usual.axes)


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

    def __init__(self, lam: float, noise: float, shape: tuple[int, int],
                 shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        height, width = shape
        self._scene = Beside(width, height, lam, noise)
        self._scene.shift = np.array(shift)
        terms = calibration(self._scene.lens)
        # The true camera, and that which the planes are seen with.
        self._true = self._camera = _model(terms)
        self._lens = self._scene.lens
        self.edges, self.focal = self._scene.edges, float(terms.matrix[0, 0])

    def estimate(self, frames: range) -> tuple[float, float]:
        """
        Replace lens and focal length by those that the arcs of some frames show.

        Returns the errors of lambda and, relative, of the focal length.
        """
        tracker, lenses, attitudes = Tracker(), LensTracker(), AttitudeTracker()
        shape, lens = self._scene.lens.shape, None
        for number in frames:
            arcs = tracker.track(self._scene.image(number), lens=lens)
            lenses.add(arcs, shape)
            lens = lenses.estimate.model if lenses.estimate else None
            attitudes.add(arcs, shape, lenses.estimate)
        assert lens is not None and attitudes.focal is not None
        self._lens, focal = lens, attitudes.focal[0]
        self._camera = _model(calibration_terms(self._lens, focal))
        return self._lens.lam - self._scene.lens.lam, focal / self.focal - 1

    def see(self, frames: range) -> list[Seen]:
        """Return what is seen in frames."""
        tracker, found = Tracker(), []
        for number in frames:
            arcs = tracker.track(self._scene.image(number), lens=self._lens)
            found.append(Seen.of(arcs, self._camera, self._scene.pose(number)))
        return found

    def visible(self, frames: range) -> np.ndarray:
        """Return in how many frames each part of each edge shows contrast: (E, BINS) int."""
        counts = np.zeros((len(self.edges), BINS), int)
        for number in frames:
            arcs = self._scene.truth(number)
            table = arcs.table[arcs.table['contrast'] >= CONTRAST]
            rays = np.stack([self._true.rays(table[end]) for end in ('start', 'end')], axis=1)
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
            off, on = self.distances(one)
            for k, track in enumerate(one.tracks.tolist()):
                frames[track] = frames.get(track, 0) + 1
                for edge in np.flatnonzero(on[k]):
                    votes.setdefault(track, {}).setdefault(int(edge), []).append(off[k, edge])
        result = {}
        for track, edges in votes.items():
            often = [(float(np.median(off)), edge) for edge, off in edges.items()
                     if len(off) >= MOST * frames[track]]
            if often:
                result[track] = min(often)[1]
        return result

    def distances(self, one: Seen, near: float = NEAR) -> tuple[np.ndarray, np.ndarray]:
        """
        Return how far planes are from edges, radians, and whether they show them: (N, E) each.

        An arc shows an edge if it lies within ``near`` px of the edge's image all along.
        """
        off, inside = _distances(self.edges, one.pose, one.planes.ends)
        return off, (off < near / self.focal) & inside

    def parts(self, one: Seen, edges: np.ndarray) -> np.ndarray:
        """Return which part of its edge, (N,), each plane shows, in shares: (N, 2), ascending."""
        start, along, normals = _seen_from(one.pose, self.edges[edges])
        cut = [-((np.cross(normals, start) * rays).sum(axis=1)
                 / (np.cross(normals, along) * rays).sum(axis=1))
               for rays in one.planes.ends.transpose(1, 0, 2)]
        return np.sort(np.stack(cut, axis=1), axis=1)

    def off_surfaces(self, points: np.ndarray) -> np.ndarray:
        """Return the distances of points, (..., 3), from the nearest surface of the room, m."""
        off = np.full(points.shape[:-1], np.inf)
        for box in furnish(self._scene.seed):
            beyond = np.abs(box.local(points)) - np.array(box.size) / 2
            outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
            off = np.minimum(off, np.abs(outside + np.minimum(beyond.max(axis=-1), 0.0)))
        return off


def _model(terms: CameraInfoTerms) -> CameraModel:
    return CameraModel(terms.distortion_model, terms.matrix, terms.coefficients)


def _seen_from(pose: Pose, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return edges (E, 2, 3) in the optical frame of a pose.

    These are (E, 3) each: the start, the way to the end, and the unit normal of the plane that
    contains the edge and the optical centre.
    """
    local = (edges - pose.centre) @ pose.rotation
    start, along = local[:, 0], local[:, 1] - local[:, 0]
    normals = np.cross(start, along)
    return start, along, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _distances(edges: np.ndarray, pose: Pose, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far rays, (N, 2, 3), are from planes of edges, and whether their middles meet."""
    start, along, normals = _seen_from(pose, edges)
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
    start, along, normals = _seen_from(pose, edges)
    off = np.abs(np.einsum('nki,ei->nke', rays, normals)).max(axis=1)
    shares = np.stack([_meet(start, along, normals, rays[:, k])[0] for k in (0, 1)], axis=-1)
    depth = _meet(start, along, normals, rays.sum(axis=1))[1]
    good = (off < EXACT) & (depth > 0) & ((shares > -1e-3) & (shares < 1.001)).all(axis=-1)
    edge = np.where(good.any(axis=1), good.argmax(axis=1), -1)
    return edge, shares[np.arange(len(rays)), edge]
