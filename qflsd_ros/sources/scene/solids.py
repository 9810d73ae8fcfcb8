"""
The geometry of the synthetic scene: boxes with patterned faces.

Lengths are in metres; in the world, x points east, y north, and z up.  The first box of a scene is
the room, seen from inside; all other boxes are within it and seen from outside.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

# A face is numbered 2 * axis + side; its u and v are the two other axes, from the lowest corner.
FACES = ('west', 'east', 'south', 'north', 'bottom', 'top')
PLANES = ((1, 2), (0, 2), (0, 1))


@dataclass(frozen=True)
class Patch:
    """A rectangle on a face, divided into a grid of cells with one colour each."""

    start: tuple[float, float]              # u, v of its lowest corner, m
    size: tuple[float, float]               # along u and v, m
    colours: np.ndarray                     # (nu, nv, 3) grey levels, blue, green, red
    glow: float = 0.0                       # 0: reflects light only, 1: emits light only
    grain: tuple[float, float, float] = (40.0, 40.0, 0.03)     # texels/m in u, in v; contrast


@dataclass(frozen=True)
class Box:
    """A cuboid, rotated about the vertical; ``patches`` are those of its faces, by FACES."""

    centre: tuple[float, float, float]      # m
    size: tuple[float, float, float]        # m
    colour: tuple[float, float, float]      # grey levels, blue, green, red
    yaw: float = 0.0                        # radians
    patches: dict[str, list[Patch]] = field(default_factory=dict)

    def rotation(self) -> np.ndarray:
        """Return the (3, 3) matrix from the box's axes to the world's."""
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])

    def local(self, points: np.ndarray) -> np.ndarray:
        """Map points of the world, (..., 3) m, to the box's axes with the origin at its centre."""
        return (points - self.centre) @ self.rotation()

    def outward(self, face: int) -> np.ndarray:
        """Return the unit normal of a face that points out of the box, (3,) in the world."""
        return self.rotation()[:, face // 2] * (1 if face % 2 else -1)


# The boxes as tables for the renderer; they have scalar fields only, the fastest ones in numba.
BOX = np.dtype([(name, np.float64) for name in (
    'half_x', 'half_y', 'half_z', 'cos', 'sin',     # half the size in m, yaw
    'eye_x', 'eye_y', 'eye_z',                      # the camera in the box's axes, m
    'lamp_x', 'lamp_y', 'lamp_z')])                 # the lamp in the box's axes, m
FACE = np.dtype([
    ('size_u', np.float64), ('size_v', np.float64),     # m
    ('box', np.int64), ('axis', np.int64),              # number of the box; axis of its normal
    ('level', np.float64),                              # where the face lies on that axis, m
    ('facing', np.float64),                             # -1 or 1, the visible side's direction
    ('ambient', np.float64),                            # light from all directions
    ('first', np.int64), ('last', np.int64)])           # its patches, from bare face to topmost
PATCH = np.dtype([
    ('u', np.float64), ('v', np.float64),               # lowest corner, m
    ('per_u', np.float64), ('per_v', np.float64),       # cells/m
    ('cells_u', np.int64), ('cells_v', np.int64), ('cell', np.int64),   # counts; first cell
    ('grain_u', np.float64), ('grain_v', np.float64), ('contrast', np.float64),
    ('glow', np.float64)])
CELL = np.dtype([('face', np.int64)] + [(name, np.float64) for name in (
    'low_u', 'low_v', 'high_u', 'high_v')])             # its rectangle on the face, m


class Surfaces(NamedTuple):
    """All boxes of a scene as tables: B boxes, P patches, N cells."""

    boxes: np.ndarray       # (B,) BOX, the camera not yet placed
    faces: np.ndarray       # (6 B,) FACE, face f of box b in row 6 b + f
    patches: np.ndarray     # (P,) PATCH
    cells: np.ndarray       # (N,) CELL
    colours: np.ndarray     # (N, 3) float64 grey levels, blue, green, red


class Edge(NamedTuple):
    """A straight edge of a box; it is visible if one of its faces is turned to the camera."""

    start: np.ndarray       # (3,) m
    end: np.ndarray         # (3,) m
    box: int
    faces: tuple[int, ...]


def surfaces(boxes: Sequence[Box], lamp: tuple[float, float, float]) -> Surfaces:
    """Return the boxes, their faces, patches and cells as tables."""
    table, faces = np.zeros(len(boxes), BOX), np.zeros(6 * len(boxes), FACE)
    patches: list[Patch] = []
    cells: list[tuple[float, ...]] = []
    for number, box in enumerate(boxes):
        table[number] = (*np.array(box.size) / 2, np.cos(box.yaw), np.sin(box.yaw), 0, 0, 0,
                         *box.local(np.array(lamp)))
        for face in range(6):
            added = face_patches(box, face)
            faces[6 * number + face] = (*_face(box, face, number), len(patches),
                                        len(patches) + len(added) - 1)
            patches += added
            cells += [(6 * number + face, *cell) for patch in added for cell in _cells(patch)]
    return Surfaces(table, faces, _patch_table(patches), np.array(cells, CELL),
                    np.concatenate([patch.colours.reshape(-1, 3) for patch in patches]))


def _face(box: Box, face: int, number: int) -> tuple[float, ...]:
    """Return the columns of FACE up to ``ambient``."""
    axis, side = divmod(face, 2)
    u, v = PLANES[axis]
    facing = (1 if side else -1) * (1 if number else -1)
    x, y, z = box.rotation()[:, axis] * facing
    return (box.size[u], box.size[v], number, axis, (side - 0.5) * box.size[axis], facing,
            0.52 + 0.1 * x - 0.06 * y + 0.1 * z)


def _patch_table(patches: Sequence[Patch]) -> np.ndarray:
    table, cell = np.zeros(len(patches), PATCH), 0
    for number, patch in enumerate(patches):
        cells_u, cells_v = patch.colours.shape[:2]
        table[number] = (*patch.start, cells_u / patch.size[0], cells_v / patch.size[1],
                         cells_u, cells_v, cell, *patch.grain, patch.glow)
        cell += cells_u * cells_v
    return table


def _cells(patch: Patch) -> list[tuple[float, float, float, float]]:
    """Return the rectangles of a patch's cells, row by row of its colours."""
    u, v = (start + np.linspace(0, size, count + 1) for start, size, count in
            zip(patch.start, patch.size, patch.colours.shape))
    return [(u[i], v[j], u[i + 1], v[j + 1]) for i in range(len(u) - 1) for j in range(len(v) - 1)]


def face_patches(box: Box, face: int) -> list[Patch]:
    """Return the patches of a face from bottom to top; the first one is the bare face itself."""
    u, v = PLANES[face // 2]
    bare = Patch((0.0, 0.0), (box.size[u], box.size[v]), np.array(box.colour).reshape(1, 1, 3))
    return [bare, *box.patches.get(FACES[face], [])]


def front_faces(boxes: Sequence[Box], position: np.ndarray) -> np.ndarray:
    """Return whether each face is turned to a position in the room: (B, 6) bool."""
    local = np.stack([box.local(position) for box in boxes])
    half = np.array([box.size for box in boxes]) / 2
    front = np.stack([local < -half, local > half], axis=-1).reshape(-1, 6)
    front[0] = True
    return front


def edges(boxes: Sequence[Box]) -> list[Edge]:
    """Return all edges of all boxes: their own, then the borders and lines of their patches."""
    found: list[Edge] = []
    for number, box in enumerate(boxes):
        lines = _box_lines(box)
        for face in range(6):
            for patch in face_patches(box, face):
                lines += [(start, end, (face,)) for start, end in _patch_lines(box, face, patch)]
        kept: list[Edge] = []
        for start, end, faces in lines:
            start, end = (box.rotation() @ (np.stack([start, end]) - 0.5 * np.array(box.size)).T
                          ).T + box.centre
            if not any(_covers(edge, start, end) for edge in kept):
                kept.append(Edge(start, end, number, faces))
        found += kept
    return found


def _box_lines(box: Box) -> list[tuple[np.ndarray, np.ndarray, tuple[int, ...]]]:
    """Return the twelve edges of a box from its lowest corner, each with its two faces."""
    lines: list[tuple[np.ndarray, np.ndarray, tuple[int, ...]]] = []
    for axis in range(3):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        for side_b, side_c in ((0, 0), (0, 1), (1, 0), (1, 1)):
            start = np.zeros(3)
            start[b], start[c] = side_b * box.size[b], side_c * box.size[c]
            end = start.copy()
            end[axis] = box.size[axis]
            lines.append((start, end, (2 * b + side_b, 2 * c + side_c)))
    return lines


def _patch_lines(box: Box, face: int, patch: Patch) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the lines of a patch's grid, its border among them, from the box's lowest corner."""
    axis, side = divmod(face, 2)
    lines = []
    for across, along in ((0, 1), (1, 0)):
        for place in np.linspace(0, patch.size[across], patch.colours.shape[across] + 1):
            ends = np.zeros((2, 3))
            ends[:, axis] = side * box.size[axis]
            ends[:, PLANES[axis][across]] = patch.start[across] + place
            ends[:, PLANES[axis][along]] = patch.start[along] + np.array([0, patch.size[along]])
            lines.append((ends[0], ends[1]))
    return lines


def _covers(edge: Edge, start: np.ndarray, end: np.ndarray) -> bool:
    """Return whether the line from start to end lies within an edge."""
    along = edge.end - edge.start
    length = float(np.linalg.norm(along))
    for point in (start, end):
        offset = point - edge.start
        share = offset @ along / length ** 2
        if not -1e-9 < share < 1 + 1e-9 or np.linalg.norm(offset - share * along) > 1e-9:
            return False
    return True
