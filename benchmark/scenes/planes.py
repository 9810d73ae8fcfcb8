"""
Plane scenes whose edges are known exactly, rendered through any lens.

board   a turned checkerboard beyond the borders of the image; an edge is a line across all squares
bars    rectangles of random size, turn and contrast that do not touch; an edge is one side
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math

from benchmark.scenes.lenses import Lens
import cv2
import numpy as np

SUPERSAMPLING = 6           # samples of a pixel along each axis
GOLDEN_SECTION = (math.sqrt(5) - 1) / 2
ROWS = 40                   # rendered at a time
POINT_SPREAD = 0.8          # px, standard deviation of the lens's blur
VERTEX = 0.5                # px in the plane between two vertices of a true line


@dataclass(frozen=True)
class Scene:
    """
    Shades and edges of a plane, in px of an image without distortion, from its centre.

    Attributes
    ----------
    shade
        Function of x and y (...,) px; returns grey levels (...,).
    edges
        (M, 2, 2) float64, start and end of every straight edge.

    """

    name: str
    shade: Callable[[np.ndarray, np.ndarray], np.ndarray]
    edges: np.ndarray


def board(lens: Lens, square: float = 0.22, turn: float = 0.2) -> Scene:
    """Return a checkerboard that fills a lens's image; ``square`` is a side in half diagonals."""
    reach, square = _reach(lens), square * math.hypot(*lens.shape) / 2
    axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    shift = np.array([0.3, 0.18]) * square

    def shade(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        u, v = (axes[k, 0] * x + axes[k, 1] * y + shift[k] for k in range(2))
        return 60 + 120 * ((np.floor(u / square) + np.floor(v / square)) % 2)

    at = square * np.arange(-math.ceil(reach / square), math.ceil(reach / square) + 1)
    far = np.full(len(at), reach)
    columns = np.stack([np.column_stack([at, -far]), np.column_stack([at, far])], axis=1)
    edges = np.concatenate([columns, columns[..., ::-1]])
    return Scene('board', shade, (edges - shift) @ axes)


def bars(lens: Lens, cell: float = 0.27, seed: int = 1) -> Scene:
    """Return one rectangle in each square cell; ``cell`` is its side in half diagonals."""
    random = np.random.default_rng(seed)
    reach, cell = _reach(lens), cell * math.hypot(*lens.shape) / 2
    half = math.ceil(reach / cell)
    shape = 2 * half, 2 * half
    turn = random.uniform(0, math.pi, shape)
    size = np.stack([random.uniform(0.13, 0.38, shape), random.uniform(0.07, 0.25, shape)]) * cell
    contrast = random.choice([-1, 1], shape) * random.uniform(25, 90, shape)

    def shade(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        i, j = (np.clip(np.floor(p / cell).astype(int) + half, 0, 2 * half - 1) for p in (x, y))
        p, q = x - (i - half + 0.5) * cell, y - (j - half + 0.5) * cell
        cos, sin = np.cos(turn)[j, i], np.sin(turn)[j, i]
        inside = ((np.abs(cos * p + sin * q) <= size[0][j, i])
                  & (np.abs(cos * q - sin * p) <= size[1][j, i]))
        return 128 + contrast[j, i] * inside

    j, i = np.indices(shape)
    centres = (np.stack([i, j], axis=-1) - half + 0.5) * cell
    along = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    across = np.stack([-np.sin(turn), np.cos(turn)], axis=-1)
    corners = [centres + u * size[0][..., None] * along + v * size[1][..., None] * across
               for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides = [np.stack([corners[k], corners[(k + 1) % 4]], axis=-2) for k in range(4)]
    return Scene('bars', shade, np.stack(sides, axis=2).reshape(-1, 2, 2))


def _reach(lens: Lens) -> float:
    """Return the distance in px from the centre that a scene must cover for a lens."""
    height, width = lens.shape
    corners = np.array([[-0.5, -0.5], [width - 0.5, height - 0.5]])
    return 1.05 * float(np.hypot(*(lens.undistort(corners) - lens.origin).T).max())


def render(scene: Scene, lens: Lens, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Return the image of a scene, (H, W) uint8, with white noise in grey levels."""
    height, width = lens.shape
    image = np.empty((height, width), np.float32)
    for top in range(0, height, ROWS):
        rows = min(ROWS, height - top)
        points = lens.undistort(_samples(rows, width) + (0, top)) - lens.origin
        fine = scene.shade(points[..., 0], points[..., 1]).astype(np.float32)
        image[top:top + rows] = cv2.resize(fine, (width, rows), interpolation=cv2.INTER_AREA)
    blurred = cv2.GaussianBlur(image, (0, 0), POINT_SPREAD)
    noisy = np.asarray(blurred + np.random.default_rng(seed).normal(0, noise, image.shape),
                       np.float32)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def _samples(rows: int, columns: int) -> np.ndarray:
    """
    Return where pixels are sampled, (rows SUPERSAMPLING, columns SUPERSAMPLING, 2) px.

    The golden section shifts each row of samples against the next, and each column: a square grid
    would have whole rows of samples on an edge along an axis.
    """
    index = np.indices((rows * SUPERSAMPLING, columns * SUPERSAMPLING))
    order = np.arange(SUPERSAMPLING) * GOLDEN_SECTION % 1
    shift = (order - order.mean())[index % SUPERSAMPLING]
    return np.moveaxis((index[::-1] + shift + 0.5) / SUPERSAMPLING - 0.5, 0, -1)


def lines(scene: Scene, lens: Lens) -> list[np.ndarray]:
    """Return the visible parts of all edges as exact polylines, (K, 2) px each."""
    limit = np.array(lens.shape[::-1]) - 1
    found = []
    for start, end in scene.edges:
        steps = max(3, math.ceil(np.hypot(*(end - start)) / VERTEX))
        share = np.linspace(0, 1, steps)[:, None]
        line = lens.distort(start + share * (end - start) + lens.origin)
        seen = ((line >= 0) & (line <= limit)).all(axis=1)
        bounds = np.flatnonzero(np.diff(seen, prepend=False, append=False))
        found += [line[a:b] for a, b in zip(bounds[::2], bounds[1::2]) if b - a > 2]
    return found
