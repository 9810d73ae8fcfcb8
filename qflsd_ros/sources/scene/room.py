"""
The room of the synthetic scene: its furniture, its lamp, and the path of the camera.

All sizes, colours and paths are invented.  They resemble a furnished room whose edges differ in
length, contrast, distance and direction, and the camera keeps clear of the furniture.
"""
from __future__ import annotations

import numpy as np

from qflsd_ros.sources.scene.solids import Box, Patch

SIZE = (6.4, 5.2, 2.8)          # m, the room along x, y, z; invented
LAMP = (3.3, 2.5, 2.45)         # m, position of the lamp; invented
# Textures: texels/m along u and v, contrast; invented.
WOOD, PLAIN = (30.0, 4.0, 0.10), (40.0, 40.0, 0.02)
# Grey levels, blue, green, red; invented.
(WHITE, CREAM, WALNUT, OAK, TEAL, RUST, SAND, SLATE) = (
    (226, 232, 236), (186, 206, 214), (52, 70, 98), (96, 138, 176),
    (128, 120, 60), (58, 84, 168), (150, 184, 204), (92, 84, 78))


def furnish(seed: int) -> list[Box]:
    """
    Return the boxes of the scene: the room, then its furniture.

    The seed determines the shades of floor boards and books, and the sizes of the rows of books;
    all other geometry is always the same.
    """
    random = np.random.default_rng(seed)
    return [_room(random), *_table(), *_cartons(), _bookcase(random), _wardrobe(), _bench(),
            _lampshade(), _rug()]


def viewpoint(turn: float) -> tuple[np.ndarray, np.ndarray]:
    """
    Return position and axes of the camera on its closed path.

    Parameters
    ----------
    turn
        Position on the path: 0 at its start, 1 back at its start.

    Returns
    -------
    position
        (3,) m.
    axes
        (3, 3): the image's x axis, its y axis and the optical axis as rows, in the world.

    """
    angle = 2 * np.pi * turn
    position = np.array([3.1 - 0.75 * np.cos(angle + 0.4), 2.35 - 0.6 * np.sin(angle + 0.4),
                         1.45 + 0.12 * np.sin(2 * angle)])
    yaw, pitch = angle + 0.72, -0.10 + 0.07 * np.sin(2 * angle + 0.5)
    roll = 0.05 * np.sin(3 * angle)
    forward = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
    right = np.cross(forward, (0, 0, 1)) / np.cos(pitch)
    down = np.cross(forward, right)
    return position, np.stack([np.cos(roll) * right + np.sin(roll) * down,
                               np.cos(roll) * down - np.sin(roll) * right, forward])


def _plain(start: tuple[float, float], size: tuple[float, float],
           colour: tuple[float, float, float], glow: float = 0.0,
           grain: tuple[float, float, float] = PLAIN) -> Patch:
    return Patch(start, size, np.array(colour, float).reshape(1, 1, 3), glow, grain)


def _shades(random: np.random.Generator, colour: tuple[float, float, float], count: int,
            spread: float) -> np.ndarray:
    """Return a row of shades of one colour, (count, 1, 3)."""
    return np.array(colour) * (1 + spread * random.uniform(-1, 1, (count, 1, 1)))


def _room(random: np.random.Generator) -> Box:
    boards = Patch((0.0, 0.0), SIZE[:2], _shades(random, (104, 140, 172), 18, 0.16).transpose(
        1, 0, 2), grain=(4.0, 30.0, 0.10))
    return Box((SIZE[0] / 2, SIZE[1] / 2, SIZE[2] / 2), SIZE, CREAM, patches={
        'bottom': [boards],
        'top': [_plain((0.0, v), (SIZE[0], 0.16), OAK, grain=(4.0, 30.0, 0.10))
                for v in (0.9, 2.5, 4.1)],
        'north': [_skirting(SIZE[0]), *_window(1.1)],
        'east': [*_door(2.5), _skirting(2.5), _skirting(SIZE[1] - 3.66, 3.66),
                 _plain((1.0, 1.25), (0.9, 0.75), WALNUT),
                 _plain((1.06, 1.31), (0.78, 0.63), WHITE),
                 _plain((1.2, 1.43), (0.5, 0.39), TEAL, grain=(60.0, 60.0, 0.3)),
                 _plain((2.25, 1.1), (0.09, 0.09), WHITE)],
        'south': [_skirting(SIZE[0])],
        'west': [_skirting(SIZE[1]), *_checkerboard(1.3), _plain((3.3, 1.2), (0.7, 0.95), SLATE),
                 _plain((3.36, 1.26), (0.58, 0.83), SAND, grain=(30.0, 30.0, 0.3))]})


def _skirting(length: float, start: float = 0.0) -> Patch:
    return _plain((start, 0.0), (length, 0.11), WHITE)


def _window(u: float) -> list[Patch]:
    panes = []
    for column in range(3):
        for row, sky in enumerate(((214, 206, 196), (248, 236, 222))):
            panes.append(_plain((u + 0.10 + 0.80 * column, 0.98 + 0.70 * row), (0.72, 0.62), sky,
                                glow=1.0, grain=(6.0, 10.0, 0.05)))
    return [_plain((u, 0.88), (2.52, 1.50), (120, 116, 108)), *panes]


def _door(u: float) -> list[Patch]:
    panels = [_plain((u + 0.22 + 0.42 * column, 0.22 + height * 0.98), (0.30, 0.80), OAK,
                     grain=WOOD) for column in range(2) for height in range(2)]
    return [_plain((u, 0.0), (1.16, 2.16), WHITE),
            _plain((u + 0.10, 0.0), (0.96, 2.06), (74, 106, 140), grain=WOOD), *panels,
            _plain((u + 0.98, 1.02), (0.05, 0.12), (60, 62, 64))]


def _checkerboard(u: float) -> list[Patch]:
    parity = np.indices((9, 6)).sum(axis=0) % 2
    squares = np.where(parity[..., None], 40.0, 235.0) * np.ones(3)
    return [_plain((u, 1.0), (1.32, 0.96), WHITE),
            Patch((u + 0.12, 1.12), (1.08, 0.72), squares, grain=PLAIN)]


def _table() -> list[Box]:
    x, y, yaw = 4.75, 3.55, 0.35
    cos, sin = np.cos(yaw), np.sin(yaw)
    legs = [Box((x + cos * u - sin * v, y + sin * u + cos * v, 0.35), (0.07, 0.07, 0.70), WALNUT,
                yaw) for u, v in ((-0.6, -0.32), (-0.6, 0.32), (0.6, -0.32), (0.6, 0.32))]
    top = Box((x, y, 0.725), (1.4, 0.8, 0.05), OAK, yaw,
              {'top': [_plain((0.0, 0.0), (1.4, 0.8), OAK, grain=(5.0, 40.0, 0.12))]})
    book = Box((x + 0.35, y - 0.05, 0.775), (0.30, 0.22, 0.05), RUST, yaw + 0.5)
    case = Box((x - 0.2, y + 0.05, 0.90), (0.34, 0.26, 0.30), TEAL, yaw - 0.4)
    return [*legs, top, book, case]


def _cartons() -> list[Box]:
    tape = {'top': [_plain((0.0, 0.26), (0.6, 0.08), SAND)],
            'south': [_plain((0.10, 0.12), (0.22, 0.16), WHITE)]}
    return [Box((0.75, 4.2, 0.30), (0.6, 0.6, 0.60), OAK, 0.25, tape),
            Box((0.78, 4.18, 0.80), (0.45, 0.40, 0.40), (110, 150, 186), -0.2,
                {'west': [_plain((0.08, 0.1), (0.2, 0.15), RUST)],
                 'south': [_plain((0.10, 0.10), (0.25, 0.18), RUST)]}),
            Box((1.6, 4.55, 0.22), (0.5, 0.44, 0.44), (84, 124, 160), -0.5)]


def _bookcase(random: np.random.Generator) -> Box:
    shelves = []
    for level in range(4):
        bottom = 0.12 + 0.5 * level
        shelves.append(_plain((0.06, bottom), (1.88, 0.42), (44, 52, 62)))
        start = 0.10
        for colour, count in zip((RUST, TEAL, SAND, SLATE), random.permutation((4, 6, 7, 9))):
            books = _shades(random, colour, count, 0.35)
            size = 0.055 * count, random.uniform(0.26, 0.38)
            shelves.append(Patch((start, bottom + 0.01), size, books, grain=PLAIN))
            start += size[0] + 0.06
    return Box((2.3, 0.18, 1.06), (2.0, 0.36, 2.12), WALNUT, patches={'north': shelves})


def _wardrobe() -> Box:
    doors = [_plain((0.05 + 0.56 * side, 0.10), (0.53, 1.85), (150, 160, 160)) for side in (0, 1)]
    knobs = [_plain((0.52 + 0.12 * side, 1.0), (0.03, 0.14), SLATE) for side in (0, 1)]
    return Box((5.0, 0.28, 1.0), (1.19, 0.56, 2.0), (120, 132, 134),
               patches={'north': [*doors, *knobs]})


def _bench() -> Box:
    return Box((2.4, 4.95, 0.22), (2.0, 0.46, 0.44), WALNUT, patches={
        'top': [_plain((0.05, 0.05), (0.92, 0.36), RUST),
                _plain((1.03, 0.05), (0.92, 0.36), TEAL)],
        'south': [_plain((0.06 + 0.96 * side, 0.07), (0.90, 0.30), OAK, grain=(5.0, 40.0, 0.12))
                  for side in (0, 1)]})


def _lampshade() -> Box:
    return Box((*LAMP[:2], 2.68), (0.9, 0.28, 0.10), WHITE, 0.35,
               {'bottom': [_plain((0.05, 0.05), (0.8, 0.18), (240, 250, 253), glow=1.0)]})


def _rug() -> Box:
    stripes = np.array([SAND, RUST, SAND, SLATE, SAND, SLATE, SAND, RUST, SAND], float)
    return Box((2.6, 2.2, 0.006), (2.1, 1.4, 0.012), SAND, -0.25, {
        'top': [Patch((0.0, 0.0), (2.1, 1.4), stripes[:, None, :], grain=(80.0, 80.0, 0.12))]})
