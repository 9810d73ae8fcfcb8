"""
The paper's Figures 3 and 4: detections of LSD and ours, each in a colour of its own.

The report shows plates of rendered scenes.  Plates of a data set, whose photographs may have any
licence, go to a folder beside the figures.
"""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmark.datasets import Dataset, LENSES, View
from benchmark.experiment import Experiment
from benchmark.peers import load, LSD, OURS
from benchmark.report import picture, section
import cv2
import numpy as np
from PIL import Image
from qflsd_ros.overlay import colours
from tqdm import tqdm

TILE = 400, 300         # px, width and height of an image on a plate
GAP = 4                 # px around an image
COLUMNS = 2             # pairs of images in a row
WHITE = 255, 255, 255
PALETTE = 64            # colours in the file
SUBPIXEL_BITS = 4       # cv2 takes fixed-point coordinates
PHOTOGRAPHS = 'photographs'


def draw(gray: np.ndarray, lines: Sequence[np.ndarray]) -> np.ndarray:
    """Return a tile: lines (K, 2) px, anti-aliased, on a pale copy of their image (H, W) uint8."""
    scale = min(TILE[0] / gray.shape[1], TILE[1] / gray.shape[0])
    small = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    pale = 255 - (255 - cv2.medianBlur(small, 5)) // 4 // 8 * 8
    tile = cv2.cvtColor(pale, cv2.COLOR_GRAY2BGR)
    for line, colour in zip(lines, (colours(np.arange(len(lines))) * 0.8).tolist()):
        fixed = (((line + 0.5) * scale - 0.5) * (1 << SUBPIXEL_BITS)).round().astype(np.int32)
        cv2.polylines(tile, [fixed], False, colour, 1, cv2.LINE_AA, SUBPIXEL_BITS)
    framed = np.full((TILE[1], TILE[0], 3), 255, np.uint8)
    framed[:tile.shape[0], :tile.shape[1]] = tile
    return framed


def plate(views: Sequence[View]) -> np.ndarray:
    """Return pairs of tiles, LSD left and ours right, as one picture."""
    pairs = []
    for view in views:
        gray = view.gray
        tiles = [draw(gray, load(name)(gray)) for name in (LSD, OURS)]
        framed = [cv2.copyMakeBorder(tile, GAP, GAP, GAP, GAP, cv2.BORDER_CONSTANT, value=WHITE)
                  for tile in tiles]
        pairs.append(np.hstack(framed))
    pairs += [np.full_like(pairs[0], 255)] * (-len(pairs) % COLUMNS)
    return np.vstack([np.hstack(pairs[i:i + COLUMNS]) for i in range(0, len(pairs), COLUMNS)])


def save(dataset: Dataset, folder: Path, count: int) -> dict[str, Path]:
    """Write a plate for each kind of lens in a data set; return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    paths: dict[str, Path] = {}
    for lens in tqdm(LENSES, 'plates'):
        views = dataset.of_lens(lens, count)
        if views:
            paths[lens] = folder / f'plate_{lens}.png'
            image = Image.fromarray(plate(views)[..., ::-1])
            image.quantize(PALETTE, dither=Image.Dither.NONE).save(paths[lens], optimize=True)
    return paths


def measure(experiment: Experiment) -> str:
    """Write the section."""
    count = experiment.effort.per_lens
    paths = save(experiment.rendered, experiment.figures, count)
    if experiment.photographs:
        save(experiment.dataset, experiment.output / PHOTOGRAPHS, count)
    return section(
        'Figures 3 and 4: detections', 'In each pair LSD left, ours right; every detection '
        'has a colour of its own. Rendered scenes through three kinds of lenses; the plane '
        'scenes of the last plate have an equidistant fisheye.',
        *(f'### {lens.capitalize()}\n\n'
          f'{picture(path, experiment.output, f"LSD and ours, {lens} lens")}'
          for lens, path in paths.items()))
