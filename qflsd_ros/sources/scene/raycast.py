"""
The renderer of the synthetic scene: it casts one ray for each corner of each pixel.

If the corners of a pixel show different cells, bisection finds where the boundary crosses the
pixel's sides, and each cell's share of the pixel is the area of a polygon.  Edges are exact to
1 / 128 px without supersampling.  A block of the image that no edge crosses shows one cell: the
rays of its four corners suffice.
"""
from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.sources.scene.optics import angles_per_pixel, Camera, near_edges, ray
from qflsd_ros.sources.scene.solids import Surfaces

TEXTURE_SIZE = 256      # texels; a power of two, so that indices wrap by a bit mask
BLOCK = 8               # px; chosen: edges would cross larger blocks more often
BAND = 64               # rows that are drawn at a time: some MB in any image; chosen, not tuned
BISECTIONS = 6          # halvings of a pixel's side: the error is at most 1 / 128 px

Place = tuple[float, float]         # x, y, px
Four = tuple[float, float, float, float]


class View(NamedTuple):
    """A scene as a camera sees it; the tables are those of :class:`Surfaces`."""

    boxes: np.ndarray       # (B,) BOX, with the camera's position
    faces: np.ndarray       # (6 B,) FACE
    patches: np.ndarray     # (P,) PATCH
    cells: np.ndarray       # (N,) CELL
    texture: np.ndarray     # (TEXTURE_SIZE, TEXTURE_SIZE) float32
    nearby: np.ndarray      # (rows, columns, B) int64: numbers of the boxes that a block may show
    camera: tuple[float, ...]   # :meth:`Camera.numbers`


class Corners(NamedTuple):
    """What the corners of the pixels show; corner (0, 0) is the top left one of pixel (0, 0)."""

    cells: np.ndarray       # (H + 1, W + 1) int32, numbers of cells
    lights: np.ndarray      # (H + 1, W + 1) float32, factors of their colours


class Crossings(NamedTuple):
    """Where boundaries of cells cross the sides of pixels, as shares of a side."""

    top: np.ndarray         # (H + 1, W + 1) float32, from the left; .5 where nothing crosses
    left: np.ndarray        # the same, from the top


@compiled
def _nearby(boxes: np.ndarray, camera: tuple[float, ...], radius: float,
            nearby: np.ndarray) -> None:
    """
    Fill in the numbers of the boxes that each block may show.

    ``nearby`` is (rows, columns, B) int64, filled with -1 before; ``radius`` is the tangent of the
    angle that half a block's diagonal covers at most.
    """
    rows, columns, _ = nearby.shape
    for row in range(rows):
        for column in range(columns):
            dx, dy, dz = ray(camera, (column + 0.5) * BLOCK - 0.5, (row + 0.5) * BLOCK - 0.5)
            size, count = sqrt(dx * dx + dy * dy + dz * dz), 0
            for b in range(len(boxes)):
                box = boxes[b]
                x, y, z = -box.eye_x, -box.eye_y, -box.eye_z
                along = ((box.cos * dx + box.sin * dy) * x + (box.cos * dy - box.sin * dx) * y
                         + dz * z) / size
                square = x * x + y * y + z * z
                ball = sqrt(box.half_x ** 2 + box.half_y ** 2 + box.half_z ** 2)
                # The cone about the block's directions must meet the sphere about the box.
                across = sqrt(max(square - along * along, 0.0))
                if square < ball * ball or across - radius * along < ball * sqrt(1 + radius ** 2):
                    nearby[row, column, count] = b
                    count += 1


@inlined
def _slab(eye: float, slope: float, half: float) -> tuple[float, float]:
    """Return the distances at which a ray enters and leaves the slab |x| <= half."""
    inverse = 1 / slope
    middle, reach = -eye * inverse, half * abs(inverse)
    return middle - reach, middle + reach


@inlined
def _hit(view: View, x: float, y: float) -> int:
    """Return the number of the face that the image shows at x, y px."""
    dx, dy, dz = ray(view.camera, x, y)
    row, column = int(y + 0.5) // BLOCK, int(x + 0.5) // BLOCK
    hit, nearest = 0, 1e30
    for k in range(view.nearby.shape[2]):
        b = view.nearby[row, column, k]
        if b < 0:
            break
        box = view.boxes[b]
        near_x, far_x = _slab(box.eye_x, box.cos * dx + box.sin * dy, box.half_x)
        near_y, far_y = _slab(box.eye_y, box.cos * dy - box.sin * dx, box.half_y)
        near_z, far_z = _slab(box.eye_z, dz, box.half_z)
        near, far = max(near_x, near_y, near_z), min(far_x, far_y, far_z)
        if b == 0:
            nearest = far
        elif near < far and 0 < near < nearest:
            hit, nearest = b, near
    box = view.boxes[hit]
    px = box.eye_x + nearest * (box.cos * dx + box.sin * dy)
    py = box.eye_y + nearest * (box.cos * dy - box.sin * dx)
    pz = box.eye_z + nearest * dz
    depth_x, depth_y = box.half_x - abs(px), box.half_y - abs(py)
    depth_z = box.half_z - abs(pz)
    if depth_z < depth_x and depth_z < depth_y:
        return 6 * hit + (5 if pz > 0 else 4)
    if depth_x < depth_y:
        return 6 * hit + (1 if px > 0 else 0)
    return 6 * hit + (3 if py > 0 else 2)


@inlined
def _meet(view: View, number: int, x: float, y: float) -> tuple[float, float, float]:
    """Return u, v (m) of a face's plane at x, y px, and the distance along the ray."""
    dx, dy, dz = ray(view.camera, x, y)
    face = view.faces[number]
    box = view.boxes[face.box]
    dx, dy = box.cos * dx + box.sin * dy, box.cos * dy - box.sin * dx
    if face.axis == 0:
        distance = (face.level - box.eye_x) / dx
        u, v = box.eye_y + distance * dy + box.half_y, box.eye_z + distance * dz + box.half_z
    elif face.axis == 1:
        distance = (face.level - box.eye_y) / dy
        u, v = box.eye_x + distance * dx + box.half_x, box.eye_z + distance * dz + box.half_z
    else:
        distance = (face.level - box.eye_z) / dz
        u, v = box.eye_x + distance * dx + box.half_x, box.eye_y + distance * dy + box.half_y
    return u, v, distance


@inlined
def _topmost(view: View, face: int, u: float, v: float) -> tuple[int, int]:
    """Return the number of the topmost patch at u, v of a face, and of its cell."""
    first, number = view.faces[face].first, view.faces[face].last
    while number > first:
        patch = view.patches[number]
        i, j = (u - patch.u) * patch.per_u, (v - patch.v) * patch.per_v
        if 0 <= i < patch.cells_u and 0 <= j < patch.cells_v:
            return number, patch.cell + int(i) * patch.cells_v + int(j)
        number -= 1
    return first, view.patches[first].cell


@inlined
def _light(view: View, number: int, u: float, v: float) -> float:
    """Return the light that falls on u, v of a face: ambient, from the lamp, less in corners."""
    face = view.faces[number]
    box = view.boxes[face.box]
    if face.axis == 0:
        towards, x, y = box.lamp_x, box.lamp_y + box.half_y - u, box.lamp_z + box.half_z - v
    elif face.axis == 1:
        towards, x, y = box.lamp_y, box.lamp_x + box.half_x - u, box.lamp_z + box.half_z - v
    else:
        towards, x, y = box.lamp_z, box.lamp_x + box.half_x - u, box.lamp_y + box.half_y - v
    towards = face.facing * (towards - face.level)
    square = towards * towards + x * x + y * y
    light = face.ambient + max(towards, 0.0) / (0.5 + square * (0.4 + 0.03 * square))
    if face.box == 0:
        rim_u, rim_v = min(u, face.size_u - u), min(v, face.size_v - v)
        light *= 1 - 0.004 / ((0.10 + rim_u * rim_u) * (0.10 + rim_v * rim_v))
    return light


@inlined
def _look(view: View, number: int, u: float, v: float, light: float) -> float:
    """Return the light that u, v of a patch reflects or emits, modulated by its texture."""
    patch, texture = view.patches[number], view.texture
    s, t = u * patch.grain_u + 37 * number + 4096, v * patch.grain_v + 4096
    i, j = int(s), int(t)
    s, t = s - i, t - j
    k, m = (i + 1) & TEXTURE_SIZE - 1, (j + 1) & TEXTURE_SIZE - 1
    i, j = i & TEXTURE_SIZE - 1, j & TEXTURE_SIZE - 1
    grain = ((1 - s) * ((1 - t) * texture[i, j] + t * texture[i, m])
             + s * ((1 - t) * texture[k, j] + t * texture[k, m]))
    return (light * (1 - patch.glow) + patch.glow) * (1 + patch.contrast * grain)


@compiled
def _cast_corners(view: View, busy: np.ndarray, corners: Corners) -> None:
    """Fill in the pixel corners in the blocks that an edge may cross: where ``busy`` is set."""
    for row in range(corners.cells.shape[0]):
        for column in range(corners.cells.shape[1]):
            if busy[row // BLOCK, column // BLOCK]:
                x, y = column - 0.5, row - 0.5
                face = _hit(view, x, y)
                u, v, _ = _meet(view, face, x, y)
                number, corners.cells[row, column] = _topmost(view, face, u, v)
                light = _light(view, face, u, v)
                corners.lights[row, column] = _look(view, number, u, v, light)


@compiled
def _cast_blocks(view: View, busy: np.ndarray, corners: Corners, place: np.ndarray) -> None:
    """
    Fill in the pixel corners in the blocks that show one cell: where ``busy`` is not set.

    ``place`` is scratch memory, (4, 3) float64: u, v and light at the block's corners.
    """
    for row in range(0, corners.cells.shape[0], BLOCK):
        for column in range(0, corners.cells.shape[1], BLOCK):
            if busy[row // BLOCK, column // BLOCK]:
                continue
            face = _hit(view, column - 0.5, row - 0.5)
            for k in range(4):
                u, v, _ = _meet(view, face, column - 0.5 + BLOCK * (k % 2),
                                row - 0.5 + BLOCK * (k // 2))
                place[k] = u, v, _light(view, face, u, v)
            number, cell = _topmost(view, face, place[0, 0], place[0, 1])
            corners.cells[row:row + BLOCK, column:column + BLOCK] = cell
            _fill(view, number, place,
                  corners.lights[row:row + BLOCK, column:column + BLOCK])


@compiled
def _fill(view: View, number: int, place: np.ndarray, lights: np.ndarray) -> None:
    """Interpolate the light of a block that shows one patch from u, v and light at its corners."""
    for i in range(lights.shape[0]):
        share = i / BLOCK
        u, v = place[0, 0] + share * (place[2, 0] - place[0, 0]), place[0, 1] + share * (
            place[2, 1] - place[0, 1])
        light = place[0, 2] + share * (place[2, 2] - place[0, 2])
        step_u = (place[1, 0] + share * (place[3, 0] - place[1, 0]) - u) / BLOCK
        step_v = (place[1, 1] + share * (place[3, 1] - place[1, 1]) - v) / BLOCK
        step = (place[1, 2] + share * (place[3, 2] - place[1, 2]) - light) / BLOCK
        for j in range(lights.shape[1]):
            lights[i, j] = _look(view, number, u + j * step_u, v + j * step_v, light + j * step)


@inlined
def _within(view: View, cell: int, x: float, y: float) -> tuple[bool, float]:
    """Return whether x, y px would show a cell if nothing hid it, and its plane's distance."""
    rectangle = view.cells[cell]
    u, v, distance = _meet(view, rectangle.face, x, y)
    return (rectangle.low_u <= u <= rectangle.high_u and rectangle.low_v <= v <= rectangle.high_v
            and distance > 0), distance


@inlined
def _crossing(view: View, first: int, second: int, start: Place, along: Place) -> float:
    """
    Return where the boundary of two cells crosses a way, as a share of the way.

    The way leads from ``start``, in the first cell, along the vector ``along`` to the second.
    """
    x, y = start
    on, far = _within(view, first, x + along[0], y + along[1])
    also, near = _within(view, second, x, y)
    # The boundary is the border of the cell that ends there; if both do, of the one in front.
    owner, wanted = (first, True) if not on and (also or far < near) else (second, False)
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        share = (low + high) / 2
        inside, _distance = _within(view, owner, x + share * along[0], y + share * along[1])
        if inside == wanted:
            low = share
        else:
            high = share
    return (low + high) / 2


@compiled
def _cross(view: View, first: int, cells: np.ndarray, crossings: Crossings) -> None:
    """
    Fill in where boundaries cross the top and the left side of each pixel.

    ``first`` is the row of the image at which ``cells`` begin.
    """
    rows, columns = cells.shape
    for row in range(rows):
        for column in range(columns):
            start, cell = (column - 0.5, first + row - 0.5), cells[row, column]
            if column + 1 < columns and cells[row, column + 1] != cell:
                crossings.top[row, column] = _crossing(
                    view, cell, cells[row, column + 1], start, (1.0, 0.0))
            if row + 1 < rows and cells[row + 1, column] != cell:
                crossings.left[row, column] = _crossing(
                    view, cell, cells[row + 1, column], start, (0.0, 1.0))


@inlined
def _shares(cells: tuple[int, int, int, int], crossings: Four) -> Four:
    """
    Return the shares of a pixel that belong to its corners.

    ``cells`` are the corners' cells: top left, top right, bottom left, bottom right; ``crossings``
    are the places where the boundary crosses the top, bottom, left and right side.  A corner owns
    the quadrilateral of itself, the crossings on its two sides, and the mean of all crossings.
    This is exact for a straight boundary, and an approximation where three cells meet.
    """
    a, b, c, d = cells
    top, bottom, left, right = crossings
    count, x, y = 0, 0.0, 0.0
    if a != b:
        count, x = count + 1, x + top
    if c != d:
        count, x, y = count + 1, x + bottom, y + 1
    if a != c:
        count, y = count + 1, y + left
    if b != d:
        count, x, y = count + 1, x + 1, y + right
    x, y = x / count, y / count
    return ((top * y + left * x) / 2, ((1 - top) * y + right * (1 - x)) / 2,
            (bottom * (1 - y) + (1 - left) * x) / 2,
            ((1 - bottom) * (1 - y) + (1 - right) * (1 - x)) / 2)


@compiled
def _mix(colours: np.ndarray, corners: Corners, crossings: Crossings, noise: np.ndarray,
         image: np.ndarray) -> None:
    """Compute the pixels from their corners, add noise and round."""
    height, width, channels = image.shape
    cells, lights, top, left = corners.cells, corners.lights, crossings.top, crossings.left
    for row in range(height):
        for column in range(width):
            a, b = cells[row, column], cells[row, column + 1]
            c, d = cells[row + 1, column], cells[row + 1, column + 1]
            p, q, r, s = 0.25, 0.25, 0.25, 0.25
            if not (a == b and a == c and a == d):
                p, q, r, s = _shares((a, b, c, d), (
                    top[row, column], top[row + 1, column],
                    left[row, column], left[row, column + 1]))
            p, q = p * lights[row, column], q * lights[row, column + 1]
            r, s = r * lights[row + 1, column], s * lights[row + 1, column + 1]
            for channel in range(channels):
                value = (p * colours[a, channel] + q * colours[b, channel]
                         + r * colours[c, channel] + s * colours[d, channel])
                value += noise[row, column, channel] + 0.5
                image[row, column, channel] = int(min(max(value, 0.0), 255.0))


def render(surfaces: Surfaces, lines: np.ndarray, camera: Camera,
           colours: np.ndarray, texture: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """
    Render the image that a camera takes of a scene.

    Parameters
    ----------
    surfaces
        The scene; the columns ``eye_x`` to ``eye_z`` of its boxes hold the camera's position.
    lines
        (N, 2, 3) m, starts and ends of all edges that may be visible.
    camera
        The camera: its lens, position and axes.
    colours
        (N, C) float64 grey levels, the colours of the cells in C channels.
    texture
        (TEXTURE_SIZE, TEXTURE_SIZE) float32, periodic in both directions.
    noise
        (N,) float32 grey levels, added to the values of the image in their order, and repeated
        where there are more values.

    Returns
    -------
    image
        (height, width, C) uint8.

    """
    height, width = shape = camera.lens.shape
    boxes, faces, patches, cells, _ = surfaces
    x, y, z = map(float, camera.position)
    numbers = camera.numbers()
    blocks = height // BLOCK + 1, width // BLOCK + 1
    least, most = angles_per_pixel(camera.lens)
    nearby, busy = np.full((*blocks, len(boxes)), -1), np.zeros(blocks, np.bool_)
    _nearby(boxes, numbers, BLOCK * most, nearby)
    near_edges(numbers, (x, y, z), lines, least * 3, BLOCK, busy)
    lights = np.full((height + 1, width + 1), 0.5, np.float32)
    view = View(boxes, faces, patches, cells, texture, nearby, numbers)
    corners = Corners(np.empty((height + 1, width + 1), np.int32), lights)
    _cast_corners(view, busy, corners)
    _cast_blocks(view, busy, corners, np.empty((4, 3)))
    image = np.empty((*shape, colours.shape[1]), np.uint8)
    _draw(view, corners, colours, noise, image)
    return image


def _draw(view: View, corners: Corners, colours: np.ndarray, noise: np.ndarray,
          image: np.ndarray) -> None:
    """Compute the pixels in bands of rows: the arrays of all rows would be larger than it."""
    height, width, channels = image.shape
    sides = np.empty((2, BAND + 1, width + 1), np.float32)
    for first in range(0, height, BAND):
        last = min(first + BAND, height)
        rows = slice(first, last + 1)
        band = Corners(corners.cells[rows], corners.lights[rows])
        sides.fill(0.5)     # where no boundary crosses, corners of one cell share in equal parts
        crossings = Crossings(*sides[:, :last - first + 1])
        _cross(view, first, band.cells, crossings)
        row = width * channels
        _mix(colours, band, crossings, _section(noise, first * row, last * row).reshape(
            last - first, width, channels), image[first:last])


def _section(values: np.ndarray, first: int, last: int) -> np.ndarray:
    """Return a section of values that are repeated without end."""
    begin, count = first % len(values), last - first
    if begin + count <= len(values):
        return values[begin:begin + count]
    return np.resize(np.roll(values, -begin), count)
