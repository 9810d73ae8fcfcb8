"""
Data sets: folders of images with annotated lines; README.md describes the format.

>>> from benchmark.datasets import Dataset
>>> Dataset.read('path/to/folder').views[0].lines      # doctest: +SKIP
"""
from __future__ import annotations

from dataclasses import dataclass
import json
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np

MANIFEST = 'manifest.json'
BOARDS = 'chess'
FISHEYE_FROM = -0.5             # lambda at which and below which a lens is called a fisheye
BENT = 2.0                      # px, smallest sagitta of a line that is called curved

Lens = Literal['regular', 'wide', 'fisheye']
LENSES: tuple[Lens, ...] = ('regular', 'wide', 'fisheye')


class DatasetError(Exception):
    """A data set that cannot be used; the text names the file and the error."""


@dataclass(frozen=True)
class View:
    """
    An image with annotated lines.

    Attributes
    ----------
    level
        The group of images to which it belongs; results are given for each.
    path
        The image file.
    lines
        (K, 2) float64 px each.
    sagitta
        (lines,) float64 px, the largest distance of each line from its chord.
    lens
        The kind of lens: ``regular``, ``wide`` or ``fisheye``.
    lam
        Lambda of the lens by the division model, 0 if it keeps lines straight; None by any other
        model.

    """

    level: str
    path: Path
    lines: list[np.ndarray]
    sagitta: np.ndarray
    lens: Lens
    lam: float | None = 0.0

    @property
    def name(self) -> str:
        """Return level and file name."""
        return f'{self.level}/{self.path.stem}'

    @property
    def gray(self) -> np.ndarray:
        """Read the image, (H, W) uint8."""
        return read_gray(self.path)

    @property
    def curved(self) -> np.ndarray | None:
        """Return which lines are curved, (lines,) bool; None where the lens is regular."""
        return None if self.lens == 'regular' else self.sagitta >= BENT


@dataclass(frozen=True)
class Board:
    """An image of a chess board: sides of its squares, outline of the annotated part."""

    path: Path
    sides: list[np.ndarray]
    outline: np.ndarray

    @property
    def name(self) -> str:
        """Return the file name."""
        return self.path.stem

    @property
    def gray(self) -> np.ndarray:
        """Read the image, (H, W) uint8."""
        return read_gray(self.path)


@dataclass(frozen=True)
class Dataset:
    """All views and boards of a folder, in the order of its manifest."""

    folder: Path
    views: list[View]
    boards: list[Board]

    @classmethod
    def read(cls, folder: str | Path) -> Dataset:
        """Read the annotations; images are read when they are needed."""
        folder = Path(folder)
        views = [_view(folder, entry) for entry in _json(folder / MANIFEST)]
        boards = [_board(folder, path) for path in sorted((folder / BOARDS).glob('*.json'))]
        if not views:
            raise DatasetError(f'{folder / MANIFEST}: lists no image')
        return cls(folder, views, boards)

    @property
    def levels(self) -> list[str]:
        """Return the levels in order of their first view."""
        return list(dict.fromkeys(view.level for view in self.views))

    def of_levels(self, count: int) -> list[View]:
        """Return at most ``count`` views of each level, the first ones, level by level."""
        return [view for level in self.levels
                for view in [view for view in self.views if view.level == level][:count]]

    def of_lens(self, lens: Lens, count: int) -> list[View]:
        """Return at most ``count`` views of a lens, evenly spread, or the first regular."""
        views = [view for view in self.views if view.lens == lens]
        if lens == 'regular' or len(views) <= count:
            return views[:count]
        return [views[i] for i in np.linspace(0, len(views) - 1, count).round().astype(int)]


def read_gray(path: Path) -> np.ndarray:
    """Return an image, (H, W) uint8; a file that cannot be read raises DatasetError."""
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise DatasetError(f'{path}: cannot be read as an image')
    return image


def lens_of(model: dict[str, Any] | None) -> Lens:
    """Return the kind of lens that an annotation's ``model`` describes."""
    if model is None:
        return 'regular'
    if model['model'] == 'division' and model['lam'] > FISHEYE_FROM:
        return 'wide'
    return 'fisheye'


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding='utf-8'))
    except (OSError, ValueError) as error:
        raise DatasetError(f'{path}: cannot be read as JSON: {error}') from error


def _view(folder: Path, entry: dict[str, Any]) -> View:
    missing = {'level', 'image', 'gt'} - entry.keys()
    if missing:
        raise DatasetError(f'{folder / MANIFEST}: a row has no {", ".join(sorted(missing))}')
    path = folder / entry['gt']
    content = _json(path)
    try:
        if 'lines' in content:
            lines = [np.array(line, float).reshape(2, 2) for line in content['lines']]
            sagitta, model = np.zeros(len(lines)), None
        else:
            lines = [np.array(line['points'], float) for line in content['polylines']]
            sagitta = np.array([line['sagitta'] for line in content['polylines']], float)
            model = content['model']
        lam = 0.0 if model is None else model.get('lam')
        return View(entry['level'], folder / entry['image'], lines, sagitta, lens_of(model), lam)
    except (KeyError, TypeError, ValueError) as error:
        raise DatasetError(f'{path}: is not an annotation: {error!r}') from error


def _board(folder: Path, path: Path) -> Board:
    content = _json(path)
    try:
        return Board(folder / content['image'], [np.array(side) for side in content['edges']],
                     np.array(content['roi']))
    except (KeyError, TypeError, ValueError) as error:
        raise DatasetError(f'{path}: is not an annotation of a board: {error!r}') from error
