"""
A rendered data set in the format of README.md, for runs without photographs.

Eight images for each kind of lens: six views of a furnished room, a checkerboard and bars.
"""
from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from benchmark.datasets import Dataset, MANIFEST
from benchmark.scenes import planes
from benchmark.scenes.lenses import EquidistantLens, Lens
import cv2
import numpy as np
from qflsd_ros.core import DivisionModel
from qflsd_ros.sources import Scene
from tqdm import tqdm

LEVELS = {'undistorted': 0.0, 'wide': -0.25, 'fisheye': -0.8}     # lambda
FIELD = 130.0           # degrees, of the equidistant fisheye
NOISE = 2.0             # grey levels
FAINTEST = 5.0          # grey levels, step of an edge that is annotated
TURN = 1200             # frame numbers in a turn of the room's camera
TOLERANCE = 0.02        # px between a true arc and its polyline


class Picture(NamedTuple):
    """An image (H, W) uint8, its true lines (K, 2) px each, and its lens in annotation format."""

    name: str
    gray: np.ndarray
    lines: list[np.ndarray]
    model: dict[str, Any] | None


def room(number: int, lam: float, shape: tuple[int, int], noise: float = NOISE) -> Picture:
    """Return a frame of the room, with its lines of a contrast of :data:`FAINTEST` or more."""
    height, width = shape
    gray, truth = Scene(width, height, lam, noise).frame(number)
    seen = truth.table['contrast'] >= FAINTEST
    lines = [line for line, keep in zip(truth.polylines(TOLERANCE), seen) if keep]
    return Picture(f'room{number:04d}', gray, lines, _division(lam))


def plane(make: Any, lens: Lens, model: dict[str, Any] | None, noise: float = NOISE) -> Picture:
    """Return :func:`planes.board` or :func:`planes.bars` through a lens."""
    scene = make(lens)
    return Picture(scene.name, planes.render(scene, lens, noise), planes.lines(scene, lens), model)


def write(folder: Path, shape: tuple[int, int], per_lens: int) -> Dataset:
    """Write ``per_lens`` (at least 2) images of (height, width) for each lens, and read them."""
    entries = []
    bar = tqdm(total=per_lens * len(LEVELS), desc='rendered scenes')
    for level, lam in LEVELS.items():
        numbers = range(0, TURN, TURN // max(1, per_lens - 2))
        pictures = [room(number, lam, shape) for number in numbers[:per_lens - 2]]
        lens: Lens = DivisionModel(lam, shape)
        model = _division(lam)
        if level == 'fisheye':
            lens, model = EquidistantLens(FIELD, shape), {'model': 'equidistant', 'field': FIELD}
        pictures += [plane(make, lens, model) for make in (planes.board, planes.bars)]
        for picture in pictures:
            entries.append(_save(folder, level, picture))
            bar.update()
    bar.close()
    (folder / MANIFEST).write_text(json.dumps(entries, indent=1), encoding='utf-8')
    return Dataset.read(folder)


def _division(lam: float) -> dict[str, Any] | None:
    return {'model': 'division', 'lam': lam} if lam else None


def sagitta(line: np.ndarray) -> float:
    """Return the largest distance of a polyline (K, 2) from its chord, px."""
    chord, offset = line[-1] - line[0], line - line[0]
    across = offset[:, 0] * chord[1] - offset[:, 1] * chord[0]
    return float(np.abs(across).max() / max(np.hypot(*chord), 1e-9))


def _save(folder: Path, level: str, picture: Picture) -> dict[str, str]:
    """Write an image and its annotation; return its row of the manifest."""
    entry = {'level': level, 'image': f'{level}/{picture.name}.png',
             'gt': f'gt/{level}_{picture.name}.json'}
    content: dict[str, Any] = {'lines': [line[[0, -1]].tolist() for line in picture.lines]}
    if picture.model is not None:
        content = {'model': picture.model, 'polylines': [
            {'points': line.round(3).tolist(), 'sagitta': sagitta(line)}
            for line in picture.lines]}
    for path in entry['image'], entry['gt']:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / entry['image']), picture.gray)
    (folder / entry['gt']).write_text(json.dumps(content), encoding='utf-8')
    return entry
