"""
A walk through the rendered room, half of it forth and half back: lines are hidden, leave, return.

A detected point belongs to the edge of the room on which it lies, and is carried to other frames
on that edge; it is in sight where the edge's exact arcs are.
"""
from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

from benchmark.metrics import Neighbours, sample, Samples
import numpy as np
from qflsd_ros.sources import Scene
from qflsd_ros.sources.scene.optics import Camera

STEP = 2                    # numbers of the room between two frames: 0.6 degrees and 1 cm
TOLERANCE, ANGLE = 2.0, 5.0
POLYLINE = 0.02             # px between a true arc and its polyline
VISIBLE = 1.0               # px from the image of a point to an exact arc of its edge
BORDER = 4.0                # px from the border of a frame, in which no line can be asked for


class View(NamedTuple):
    """The exact arcs of a frame as pieces, the edge (from 0) of each piece, and the camera."""

    pieces: Samples
    edge: np.ndarray
    camera: Camera


class ReturnWalk:
    """
    Frames of the room, and the places of points in all of them.

    Parameters
    ----------
    shape
        Height and width, px.
    lam
        Lambda of the lens by the division model.
    frames
        Number of frames, back at the start with the last one.
    start
        Number of the first frame in the room's own path.

    """

    def __init__(self, shape: tuple[int, int], lam: float, frames: int, start: int) -> None:
        self._scene = Scene(shape[1], shape[0], lam)
        self.size = np.array(shape[::-1])
        forth = np.arange(frames)
        self._numbers = (start + STEP * np.minimum(forth, frames - 1 - forth)).tolist()
        self._views: dict[int, View] = {}

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._numbers)

    def frame(self, i: int) -> np.ndarray:
        """Return frame i, (H, W) uint8."""
        return self._scene.image(self._numbers[i])

    @cached_property
    def _edges(self) -> np.ndarray:
        return self._scene.edges

    def _view(self, i: int) -> View:
        number = self._numbers[i]
        if number not in self._views:
            truth, pose = self._scene.truth(number), self._scene.pose(number)
            pieces = sample(truth.polylines(POLYLINE))
            edge = truth.table['track'].astype(int)[pieces.line] - 1
            camera = Camera(self._scene.lens, pose[:3, 3], pose[:3, :3].T)
            self._views[number] = View(pieces, edge, camera)
        return self._views[number]

    def carry(self, pieces: Samples, i: int, j: int) -> np.ndarray:
        """Return the middles (N, 2) px of pieces of frame i in frame j; nan where not in sight."""
        here, there = self._view(i), self._view(j)
        nearest = Neighbours(pieces, here.pieces).match(TOLERANCE, ANGLE)[0]
        edge = np.where(nearest >= 0, here.edge[nearest], -1)
        moved = there.camera.project(self._in_space(pieces.points, edge, here.camera))
        inside = ((moved >= BORDER) & (moved <= self.size - 1 - BORDER)).all(axis=1)
        seen = (edge >= 0) & inside
        seen[seen] = _is_on_its_edge(moved[seen], edge[seen], there)
        return np.where(seen[:, None], moved, np.nan)

    def _in_space(self, points: np.ndarray, edge: np.ndarray, camera: Camera) -> np.ndarray:
        """Return the points (N, 3) m of edges that are closest to the rays of image points."""
        start, end = self._edges[edge].transpose(1, 0, 2)
        along, ray, offset = end - start, camera.rays(points), start - camera.position
        # The plane through the ray, upright on that of ray and edge, cuts the edge.
        across = np.cross(ray, np.cross(along, ray))
        share = -(offset * across).sum(axis=1) / (along * across).sum(axis=1)
        return start + share[:, None] * along


def _is_on_its_edge(points: np.ndarray, edge: np.ndarray, view: View) -> np.ndarray:
    """Return whether an exact arc of its edge is near each point: (N,) bool."""
    on = np.zeros(len(points), bool)
    for number in np.unique(edge):
        mine = edge == number
        arcs = view.edge == number
        if arcs.any():
            away = np.linalg.norm(points[mine][:, None] - view.pieces.points[arcs], axis=2)
            on[mine] = away.min(axis=1) <= VISIBLE
    return on
