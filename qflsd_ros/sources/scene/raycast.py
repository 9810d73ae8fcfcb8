"""
The renderer of the synthetic scene: it casts one ray for each corner of each pixel.

If the corners of a pixel show different cells, bisection finds where the boundary crosses the
pixel's sides, and each cell's share of the pixel is the area of a polygon.  Edges are exact to
1 / 128 px without supersampling.  A block of the image that no edge crosses shows one cell: the
rays of its four corners suffice.
"""
from __future__ import annotations

from math import sqrt

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.sources.scene.optics import angles_per_pixel, Camera, near_edges, ray
from qflsd_ros.sources.scene.solids import Surfaces

TEXTURE_SIZE = 256      # texels; a power of two, so that indices wrap by a bit mask
BLOCK = 8               # px; larger blocks would be crossed by edges more often
BISECTIONS = 6          # halvings of a pixel's side: the error is at most 1 / 128 px


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
def _hit(boxes: np.ndarray, nearby: np.ndarray, camera: tuple[float, ...], x: float,
         y: float) -> int:
    """Return the number of the face that the image shows at x, y px."""
    dx, dy, dz = ray(camera, x, y)
    row, column = int(y + 0.5) // BLOCK, int(x + 0.5) // BLOCK
    hit, nearest = 0, 1e30
    for k in range(nearby.shape[2]):
        b = nearby[row, column, k]
        if b < 0:
            break
        box = boxes[b]
        near_x, far_x = _slab(box.eye_x, box.cos * dx + box.sin * dy, box.half_x)
        near_y, far_y = _slab(box.eye_y, box.cos * dy - box.sin * dx, box.half_y)
        near_z, far_z = _slab(box.eye_z, dz, box.half_z)
        near, far = max(near_x, near_y, near_z), min(far_x, far_y, far_z)
        if b == 0:
            nearest = far
        elif near < far and 0 < near < nearest:
            hit, nearest = b, near
    box = boxes[hit]
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
def _meet(boxes: np.ndarray, faces: np.ndarray, number: int, camera: tuple[float, ...], x: float,
          y: float) -> tuple[float, float, float]:
    """Return u, v (m) of a face's plane at x, y px, and the distance along the ray."""
    dx, dy, dz = ray(camera, x, y)
    face = faces[number]
    box = boxes[face.box]
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
def _topmost(faces: np.ndarray, patches: np.ndarray, face: int, u: float,
             v: float) -> tuple[int, int]:
    """Return the number of the topmost patch at u, v of a face, and of its cell."""
    first, number = faces[face].first, faces[face].last
    while number > first:
        patch = patches[number]
        i, j = (u - patch.u) * patch.per_u, (v - patch.v) * patch.per_v
        if 0 <= i < patch.cells_u and 0 <= j < patch.cells_v:
            return number, patch.cell + int(i) * patch.cells_v + int(j)
        number -= 1
    return first, patches[first].cell


@inlined
def _light(boxes: np.ndarray, faces: np.ndarray, number: int, u: float, v: float) -> float:
    """Return the light that falls on u, v of a face: ambient, from the lamp, less in corners."""
    face = faces[number]
    box = boxes[face.box]
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
def _look(patches: np.ndarray, texture: np.ndarray, number: int, u: float, v: float,
          light: float) -> float:
    """Return the light that u, v of a patch reflects or emits, modulated by its texture."""
    patch = patches[number]
    s, t = u * patch.grain_u + 37 * number + 4096, v * patch.grain_v + 4096
    i, j = int(s), int(t)
    s, t = s - i, t - j
    k, m = (i + 1) & TEXTURE_SIZE - 1, (j + 1) & TEXTURE_SIZE - 1
    i, j = i & TEXTURE_SIZE - 1, j & TEXTURE_SIZE - 1
    grain = ((1 - s) * ((1 - t) * texture[i, j] + t * texture[i, m])
             + s * ((1 - t) * texture[k, j] + t * texture[k, m]))
    return (light * (1 - patch.glow) + patch.glow) * (1 + patch.contrast * grain)


@compiled
def _cast_corners(boxes: np.ndarray, faces: np.ndarray, patches: np.ndarray, nearby: np.ndarray,
                  camera: tuple[float, ...], texture: np.ndarray, busy: np.ndarray,
                  cells: np.ndarray, lights: np.ndarray) -> None:
    """Fill in cell and light of each pixel corner in the blocks that an edge may cross."""
    for row in range(cells.shape[0]):
        for column in range(cells.shape[1]):
            if busy[row // BLOCK, column // BLOCK]:
                x, y = column - 0.5, row - 0.5
                face = _hit(boxes, nearby, camera, x, y)
                u, v, _ = _meet(boxes, faces, face, camera, x, y)
                number, cells[row, column] = _topmost(faces, patches, face, u, v)
                light = _light(boxes, faces, face, u, v)
                lights[row, column] = _look(patches, texture, number, u, v, light)


@compiled
def _cast_blocks(boxes: np.ndarray, faces: np.ndarray, patches: np.ndarray, nearby: np.ndarray,
                 camera: tuple[float, ...], texture: np.ndarray, busy: np.ndarray,
                 cells: np.ndarray, lights: np.ndarray, place: np.ndarray) -> None:
    """
    Fill in cell and light of each pixel corner in the blocks that show one cell.

    ``place`` is scratch memory, (4, 3) float64: u, v and light at the block's corners.
    """
    for row in range(0, cells.shape[0], BLOCK):
        for column in range(0, cells.shape[1], BLOCK):
            if busy[row // BLOCK, column // BLOCK]:
                continue
            face = _hit(boxes, nearby, camera, column - 0.5, row - 0.5)
            for k in range(4):
                u, v, _ = _meet(boxes, faces, face, camera, column - 0.5 + BLOCK * (k % 2),
                                row - 0.5 + BLOCK * (k // 2))
                place[k] = u, v, _light(boxes, faces, face, u, v)
            number, cell = _topmost(faces, patches, face, place[0, 0], place[0, 1])
            cells[row:row + BLOCK, column:column + BLOCK] = cell
            _fill(patches, texture, number, place, lights[row:row + BLOCK, column:column + BLOCK])


@compiled
def _fill(patches: np.ndarray, texture: np.ndarray, number: int, place: np.ndarray,
          lights: np.ndarray) -> None:
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
            lights[i, j] = _look(patches, texture, number, u + j * step_u, v + j * step_v,
                                 light + j * step)


@compiled
def _within(boxes: np.ndarray, faces: np.ndarray, rectangles: np.ndarray,
            camera: tuple[float, ...], cell: int, x: float, y: float) -> tuple[bool, float]:
    """Return whether x, y px would show a cell if nothing hid it, and its plane's distance."""
    rectangle = rectangles[cell]
    u, v, distance = _meet(boxes, faces, rectangle.face, camera, x, y)
    return (rectangle.low_u <= u <= rectangle.high_u and rectangle.low_v <= v <= rectangle.high_v
            and distance > 0), distance


@compiled
def _crossing(boxes: np.ndarray, faces: np.ndarray, rectangles: np.ndarray,
              camera: tuple[float, ...], first: int, second: int, x: float, y: float,
              along_x: float, along_y: float) -> float:
    """
    Return where the boundary of two cells crosses the way from x, y px, as a share of the way.

    The way leads along (along_x, along_y) from the first cell to the second.
    """
    on, far = _within(boxes, faces, rectangles, camera, first, x + along_x, y + along_y)
    also, near = _within(boxes, faces, rectangles, camera, second, x, y)
    # The boundary is the border of the cell that ends there; if both do, of the one in front.
    owner, wanted = (first, True) if not on and (also or far < near) else (second, False)
    rectangle = rectangles[owner]
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        share = (low + high) / 2
        u, v, distance = _meet(boxes, faces, rectangle.face, camera, x + share * along_x,
                               y + share * along_y)
        inside = (rectangle.low_u <= u <= rectangle.high_u
                  and rectangle.low_v <= v <= rectangle.high_v and distance > 0)
        if inside == wanted:
            low = share
        else:
            high = share
    return (low + high) / 2


@compiled
def _cross(boxes: np.ndarray, faces: np.ndarray, rectangles: np.ndarray, camera: tuple[float, ...],
           cells: np.ndarray, top: np.ndarray, left: np.ndarray) -> None:
    """Fill in the shares at which boundaries cross the top and the left side of each pixel."""
    rows, columns = cells.shape
    for row in range(rows):
        for column in range(columns):
            x, y, cell = column - 0.5, row - 0.5, cells[row, column]
            if column + 1 < columns and cells[row, column + 1] != cell:
                top[row, column] = _crossing(boxes, faces, rectangles, camera, cell,
                                             cells[row, column + 1], x, y, 1.0, 0.0)
            if row + 1 < rows and cells[row + 1, column] != cell:
                left[row, column] = _crossing(boxes, faces, rectangles, camera, cell,
                                              cells[row + 1, column], x, y, 0.0, 1.0)


@inlined
def _shares(a: int, b: int, c: int, d: int, top: float, bottom: float, left: float,
            right: float) -> tuple[float, float, float, float]:
    """
    Return the shares of a pixel that belong to its corners, with the cells a b above c d.

    A corner owns the quadrilateral of itself, the crossings on its two sides, and the mean of all
    crossings.  This is exact for a straight boundary, and an approximation where three cells meet.
    """
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
def _mix(colours: np.ndarray, cells: np.ndarray, lights: np.ndarray, top: np.ndarray,
         left: np.ndarray, noise: np.ndarray, image: np.ndarray) -> None:
    """Compute the pixels from their corners, add noise and round."""
    height, width, channels = image.shape
    for row in range(height):
        for column in range(width):
            a, b = cells[row, column], cells[row, column + 1]
            c, d = cells[row + 1, column], cells[row + 1, column + 1]
            p, q, r, s = 0.25, 0.25, 0.25, 0.25
            if not (a == b and a == c and a == d):
                p, q, r, s = _shares(a, b, c, d, top[row, column], top[row + 1, column],
                                     left[row, column], left[row, column + 1])
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
        (height, width, C) float32 grey levels, added to the image.

    Returns
    -------
    image
        (height, width, C) uint8.

    """
    height, width = camera.lens.shape
    boxes, faces, patches, rectangles, _ = surfaces
    x, y, z = map(float, camera.position)
    numbers = camera.numbers()
    blocks = height // BLOCK + 1, width // BLOCK + 1
    least, most = angles_per_pixel(camera.lens)
    nearby, busy = np.full((*blocks, len(boxes)), -1), np.zeros(blocks, np.bool_)
    _nearby(boxes, numbers, BLOCK * most, nearby)
    near_edges(numbers, (x, y, z), lines, least * 3, BLOCK, busy)
    cells = np.empty((height + 1, width + 1), np.int32)
    lights, top, left = np.full((3, height + 1, width + 1), 0.5, np.float32)
    scene = boxes, faces, patches, nearby, numbers, texture, busy
    _cast_corners(*scene, cells, lights)
    _cast_blocks(*scene, cells, lights, np.empty((4, 3)))
    _cross(boxes, faces, rectangles, numbers, cells, top, left)
    image = np.empty(noise.shape, np.uint8)
    _mix(colours, cells, lights, top, left, noise, image)
    return image
