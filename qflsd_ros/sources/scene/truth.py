"""The exact arcs of the synthetic scene: the images of the visible pieces of its edges."""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from qflsd_ros.core.arcs import Arcs, TRACKED_TABLE
from qflsd_ros.sources.scene.optics import Camera, FOCAL
from qflsd_ros.sources.scene.solids import Box, Edge, front_faces

SHORTEST = 1.0      # px, length of the shortest arc: less than any detector reports
BESIDE = 1.5        # px from an edge to where its contrast is measured: beside mixed pixels
SPACING = 2.0       # px between such measurements along an edge; chosen


def visible_arcs(edges: Sequence[Edge], boxes: Sequence[Box], camera: Camera,
                 image: np.ndarray) -> Arcs:
    """
    Return the arcs that are the images of all visible pieces of edges.

    Parameters
    ----------
    edges, boxes
        The scene; the first box is the room.
    camera
        The camera: its lens, position and axes.
    image
        (H, W) uint8, the frame without noise, in which contrast and polarity are measured.

    Returns
    -------
    arcs
        Columns that only a detection has (as ``rms``) are 0, and the arcs have no edge points.
        The column ``track`` is the number of the edge, from 1: all its pieces have the same.

    """
    front = front_faces(boxes, camera.position)
    rows = [_arc(edge, track, camera, *piece) for track, edge in enumerate(edges, 1)
            if any(front[edge.box, face] for face in edge.faces)
            for piece in _pieces(edge, boxes, camera)]
    table = np.array([row for row in rows if row['length'] >= SHORTEST],
                     TRACKED_TABLE)
    offsets = np.zeros(len(table) + 1, np.int64)
    arcs = Arcs(table, np.zeros((0, 2)), np.zeros((0, 2), np.int32), offsets)
    for row, line in zip(table, arcs.polylines(0.01)):
        row['contrast'], polarity = _step(image, line)
        row['polarity'] = abs(polarity)
        if polarity < 0:
            row['start'], row['end'] = row['end'].copy(), row['start'].copy()
            row['curvature'] *= -1
    return arcs


def _pieces(edge: Edge, boxes: Sequence[Box], camera: Camera) -> list[tuple[float, float]]:
    """Return the visible pieces of an edge, each from one share of its length to another."""
    hidden = [interval for number, box in enumerate(boxes[1:], 1) if number != edge.box
              for interval in _hidden(edge, box, camera.position)]
    cuts = [0.0, 1.0, *_border_crossings(edge, camera), *(cut for pair in hidden for cut in pair)]
    cuts = sorted(cut for cut in cuts if 0 <= cut <= 1)
    height, width = camera.lens.shape
    pieces: list[tuple[float, float]] = []
    for low, high in zip(cuts[:-1], cuts[1:]):
        middle = (low + high) / 2
        x, y = camera.project(edge.start + middle * (edge.end - edge.start))
        if (-0.5 < x < width - 0.5 and -0.5 < y < height - 0.5
                and not any(first < middle < last for first, last in hidden)):
            if pieces and pieces[-1][1] == low:
                low = pieces.pop()[0]
            pieces.append((low, high))
    return pieces


def _hidden(edge: Edge, box: Box, eye: np.ndarray) -> list[tuple[float, float]]:
    """
    Return the interval of an edge that a box hides, as shares of its length; empty without one.

    In the coordinates s, w of the point ``eye + s (start - eye) + w (end - start)``, the triangle
    of eye and edge is (0, 0), (1, 0), (1, 1).  It is clipped to the box; the point s, w hides the
    share w / s of the edge.
    """
    origin = box.local(eye)
    towards = (edge.start - eye) @ box.rotation()
    along = (edge.end - edge.start) @ box.rotation()
    polygon = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]
    for axis in range(3):
        for sign in (1, -1):
            # The margin leaves edges visible that touch the box.
            reach = box.size[axis] / 2 - 1e-7 - sign * origin[axis]
            polygon = _clip(polygon, sign * towards[axis], sign * along[axis], reach)
    shares = [w / s for s, w in polygon if s > 0]
    return [(min(shares), max(shares))] if shares else []


def _clip(polygon: list[tuple[float, float]], a: float, b: float,
          c: float) -> list[tuple[float, float]]:
    """Clip a convex polygon to the half plane a x + b y <= c (Sutherland and Hodgman)."""
    kept = []
    for (x, y), (u, v) in zip(polygon, polygon[1:] + polygon[:1]):
        here, there = a * x + b * y - c, a * u + b * v - c
        if here <= 0:
            kept.append((x, y))
        if here * there < 0:
            share = here / (here - there)
            kept.append((x + share * (u - x), y + share * (v - y)))
    return kept


def _circle(edge: Edge, camera: Camera) -> tuple[float, float, float, float]:
    """
    Return A, B, C, D of the circle A (x^2 + y^2) + B x + C y + D = 0 that is an edge's image.

    The origin is the distortion centre, the unit half the image's diagonal.
    """
    start = camera.axes @ (edge.start - camera.position)
    b, c, n = np.cross(start, camera.axes @ (edge.end - edge.start))
    return FOCAL * camera.lens.lam * n, b, c, FOCAL * n


def _border_crossings(edge: Edge, camera: Camera) -> list[float]:
    """Return the shares of an edge's length at which its image crosses the image's borders."""
    a, b, c, d = _circle(edge, camera)
    height, width = camera.lens.shape
    corners = (np.array([[-0.5, -0.5], [width - 0.5, height - 0.5]]) - camera.lens.origin
               ) / camera.lens.half_diagonal
    crossings = []
    for x in corners[:, 0]:
        crossings += [(x, y) for y in _roots(a, c, a * x * x + b * x + d)]
    for y in corners[:, 1]:
        crossings += [(x, y) for x in _roots(a, b, a * y * y + c * y + d)]
    if not crossings:
        return []
    rays = camera.rays(np.array(crossings) * camera.lens.half_diagonal + camera.lens.origin)
    start, along = edge.start - camera.position, edge.end - edge.start
    normal = np.cross(start, along)
    return list(-(np.cross(start, rays) @ normal) / (np.cross(along, rays) @ normal))


def _roots(a: float, b: float, c: float) -> list[float]:
    """Return the real roots of a x^2 + b x + c, by the formula without cancellation."""
    square = b * b - 4 * a * c
    if square < 0:
        return []
    half = -(b + np.copysign(np.sqrt(square), b)) / 2
    return [x / y for x, y in ((half, a), (c, half)) if y != 0]


def _arc(edge: Edge, track: int, camera: Camera, low: float, high: float) -> np.ndarray:
    """Return the row of the table for the piece of an edge between two shares of its length."""
    shares = np.array([low, low + 0.01 * (high - low), high])
    start, soon, end = camera.project(edge.start + shares[:, None] * (edge.end - edge.start))
    a, b, c, d = _circle(edge, camera)
    a, b, c = np.array([a, b, c]) / np.sqrt(b * b + c * c - 4 * a * d)
    x, y = (start - camera.lens.origin) / camera.lens.half_diagonal
    tangent = np.array([-(2 * a * y + c), 2 * a * x + b])
    direction = np.copysign(1, tangent @ (soon - start))
    chord = end - start
    across = np.array([-chord[1], chord[0]])
    half = -np.arctan2(direction * tangent @ across, direction * tangent @ chord)
    row = np.zeros((), TRACKED_TABLE)
    row['track'] = track
    row['start'], row['end'] = start, end
    row['middle'] = (start + end) / 2 - across / 2 * np.tan(half / 2)
    row['curvature'] = direction * 2 * a / camera.lens.half_diagonal
    row['length'] = np.hypot(*chord) / np.sinc(half / np.pi)
    return row


def _step(image: np.ndarray, line: np.ndarray) -> tuple[float, float]:
    """Return contrast and polarity of a polyline; polarity < 0 if its left side is brighter."""
    way = np.concatenate([[0], np.hypot(*np.diff(line, axis=0).T).cumsum()])
    places = np.linspace(0, way[-1], 2 + int(way[-1] / SPACING))
    points = np.stack([np.interp(places, way, axis) for axis in line.T], axis=1)
    along, middles = np.diff(points, axis=0), (points[:-1] + points[1:]) / 2
    across = BESIDE * np.c_[-along[:, 1], along[:, 0]] / np.hypot(*along.T)[:, None]
    limit = np.array(image.shape[::-1]) - 1
    right, left = (np.clip(np.rint(middles + sign * across), 0, limit).astype(int)
                   for sign in (1, -1))
    step = image[right[:, 1], right[:, 0]].astype(float) - image[left[:, 1], left[:, 0]]
    return float(np.abs(step).mean()), float(np.sign(step).mean())
