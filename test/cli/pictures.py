"""Pictures and videos to detect in, and checks of the files with their results."""
from __future__ import annotations

from collections.abc import Iterable
import csv
import json
from pathlib import Path

import cv2
import numpy as np
from qflsd_ros.core import Arcs, Detector, Parameters


def picture(seed: int, size: tuple[int, int] = (200, 150)) -> np.ndarray:
    """Return bright rectangles on a dark ground: (150, 200, 3) uint8."""
    generator = np.random.default_rng(seed)
    pixels = np.full((size[1], size[0], 3), 30, np.uint8)
    for _ in range(3):
        x, y = generator.integers(10, 60, 2).tolist()
        colour = generator.integers(100, 250, 3).tolist()
        cv2.rectangle(pixels, (x, y), (x + 100, y + 70), colour, -1)
    return pixels


def write_video(path: Path, frames: Iterable[np.ndarray]) -> Path:
    """Write frames of one size, (H, W, 3) uint8, as a video and return its path."""
    writer = None
    for frame in frames:
        writer = writer or cv2.VideoWriter(
            str(path), cv2.VideoWriter_fourcc(*'MJPG'), 10, frame.shape[1::-1])
        writer.write(frame)
    writer.release()
    return path


def expected(pixels: np.ndarray, parameters: Parameters = Parameters()) -> Arcs:
    """Return what the detector itself finds."""
    return Detector(parameters).detect(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY))


def check_csv(path: Path, arcs: Arcs) -> None:
    """Check that a CSV file holds every arc, to the last bit."""
    rows = list(csv.DictReader(path.open(newline='')))
    assert len(rows) == len(arcs)
    assert list(rows[0])[:4] == ['start_x', 'start_y', 'middle_x', 'middle_y']
    for name in ('start', 'end'):
        found = [[float(row[f'{name}_x']), float(row[f'{name}_y'])] for row in rows]
        np.testing.assert_array_equal(found, arcs.table[name])
    for name in ('curvature', 'length', 'rms', 'support'):
        np.testing.assert_array_equal([float(row[name]) for row in rows], arcs.table[name])


def read_json(path: Path) -> dict:
    return json.loads(path.read_text())
