"""
Differences of the results between numbers of threads and versions of OpenCV and numpy.

``script/benchmark`` installs the oldest supported versions in a folder of their own, ``oldest`` in
``.venv``.  Without that folder, only numbers of threads are compared.
"""
from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys
import tempfile

from benchmark.datasets import Dataset, View
from benchmark.experiment import Experiment
from benchmark.report import number, ROOT, section, table
import cv2
import numpy as np
from qflsd_ros.core import Detector
from tqdm import tqdm

OLDEST = Path(sys.prefix) / 'oldest'
MOST = 1e-3             # px, largest difference wanted
PLACES = 'start', 'middle', 'end'


def views(folder: str | Path, per_level: int) -> list[View]:
    """Return the images on which results are compared."""
    return Dataset.read(folder).of_levels(per_level)


def dump(folder: str, per_level: int, threads: int, path: str) -> None:
    """Write the places of the arcs of all images, (M, 6) px each, and the versions."""
    cv2.setNumThreads(threads)
    detector, found = Detector(), {}
    for i, view in enumerate(tqdm(views(folder, per_level), f'{threads} threads')):
        arcs = detector.detect(view.gray).table
        found[f'image {i}'] = np.hstack([arcs[name] for name in PLACES])
    versions = np.array(f'OpenCV {cv2.__version__}, numpy {np.__version__}')
    np.savez(path, allow_pickle=False, versions=versions, **found)


def run(experiment: Experiment, threads: int, libraries: Path | None) -> dict[str, np.ndarray]:
    """Return the output of :func:`dump`, run in a process that finds other libraries first."""
    environment = dict(os.environ)
    if libraries is not None:
        environment['PYTHONPATH'] = f'{libraries}{os.pathsep}{environment.get("PYTHONPATH", "")}'
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / 'found.npz')
        subprocess.run([
            sys.executable, '-m', 'benchmark.experiments.sameness', str(experiment.dataset.folder),
            str(experiment.effort.per_level), str(threads), path], check=True, cwd=ROOT,
            env=environment)
        with np.load(path) as content:
            return dict(content)


def difference(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> tuple[int, float]:
    """Return the number of images whose numbers of arcs differ, and the largest distance in px."""
    pairs = [(one[name], other[name]) for name in one if name != 'versions']
    away = [float(np.abs(a - b).max(initial=0)) for a, b in pairs if a.shape == b.shape]
    return len(pairs) - len(away), max(away, default=0.0)


def measure(experiment: Experiment) -> str:
    """Write the section."""
    usual = run(experiment, 1, None)
    others = [(2, run(experiment, 2, None))]
    if OLDEST.is_dir():
        others.append((1, run(experiment, 1, OLDEST)))
    arcs = sum(len(rows) for name, rows in usual.items() if name != 'versions')
    rows = []
    for threads, found in others:
        images, away = difference(usual, found)
        rows.append((str(found['versions']), threads, images, f'{away:.1e}',
                     'yes' if images == 0 and away <= MOST else 'no'))
    return section(
        'Sameness', f'{len(usual) - 1} images, {arcs} arcs; the reference is '
        f'{usual["versions"]} with one thread. Goal: the same number of arcs on every image, '
        f'each within {number(MOST)} px.',
        table(('versions', 'threads', 'images with another number of arcs',
               'largest difference, px', 'reached'), rows))


if __name__ == '__main__':
    dump(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4])
