"""Attitude and focal length: of single images, and over the frames of a camera."""
from __future__ import annotations

from collections.abc import Iterable, Iterator
import json
import math
from pathlib import Path
from typing import NamedTuple

from benchmark.experiment import Experiment
from benchmark.report import number, section, table
from benchmark.scenes.rendered import NOISE, TURN
from benchmark.timing import run
import cv2
import numpy as np
from qflsd_ros.core import (
    AttitudeTracker, Detector, estimate_attitude, estimate_distortion, Tracker)
from qflsd_ros.core.lens.tracker import LensTracker
from qflsd_ros.sources import Scene
from qflsd_ros.sources.scene.optics import FOCAL
from qflsd_ros.sources.scene.room import viewpoint
from tqdm import tqdm

LAMBDAS = 0.0, -0.3, -0.6, -0.9
TRUTH = 'truth.json'    # of a folder of photographs
FRAMES_A_VIEW = 4       # frames of the room for each of its viewpoints under other conditions
SECONDS = 3             # of the room over time, at the effort's frames a second

SINGLE = (
    '`estimate_attitude` of single images, nothing given but the image. *Told*: share of images '
    'with a focal length, and with up; focal: relative error, median / 90th percentile / z; bias: '
    'mean of ln f over the true one, %; up: error in degrees, the same; z: rms of error over '
    'stated deviation, 1 is honest; ms: median CPU time of the call. In the room nothing deviates '
    'from right angles and the division model, which the stated deviations allow for.')
LIVE = (
    f'`AttitudeTracker` in the room, {SECONDS} s: error of the focal length at the end, of up '
    '(median), mean CPU time a frame; labels: share of arcs of a track that change their '
    'direction from one frame to the next, %. *Still*: rms deviation of heading and up from '
    'their mean while the camera stands still, degrees.')


class Photograph(NamedTuple):
    """An image with the true focal length (px at the centre), and up in the optical frame."""

    level: str
    gray: np.ndarray
    focal: float
    up: np.ndarray


class Measured(NamedTuple):
    """Logarithm of the focal length over the true one, up in degrees, each with z; ms."""

    focal: float
    focal_z: float
    up: float
    up_z: float
    ms: float


def measure(experiment: Experiment) -> str:
    """Write the section."""
    effort = experiment.effort
    lambdas = LAMBDAS[::effort.every]
    singles = [_row(f'room, lambda {lam:g}', map(estimate, _rooms(experiment, lam)))
               for lam in tqdm(lambdas, 'attitude')]
    if experiment.attitudes:
        singles += [_row(level, map(estimate, pictures))
                    for level, pictures in _photographs(experiment.attitudes).items()]
    live = [(f'{lam:g}', *_live(lam, effort.shape, SECONDS * effort.frames))
            for lam in tqdm(lambdas, 'attitude over time')]
    return section(
        'Attitude', SINGLE,
        table(('images', 'count', 'told f', 'told up', 'focal', 'bias', 'up', 'ms'), singles),
        LIVE, table(('lambda', 'focal, %', 'up', 'ms', 'labels, %', 'still: heading',
                     'still: up'), live))


def estimate(picture: Photograph) -> Measured:
    """Estimate the attitude of one image."""
    arcs, shape = Detector().detect(picture.gray), picture.gray.shape
    lens = estimate_distortion([arcs], shape)
    seconds, found = run(estimate_attitude, arcs, shape, lens)
    focal = focal_z = up = up_z = math.nan
    if found is not None and found.focal is not None and found.focal_std is not None:
        focal = math.log(found.focal / picture.focal)
        focal_z = (found.focal - picture.focal) / found.focal_std
    if found is not None and found.up is not None and found.up_std is not None:
        up = _angle(found.up, picture.up)
        # The deviation is that of each of two directions.
        up_z = math.radians(up) / found.up_std / math.sqrt(2)
    return Measured(focal, focal_z, up, up_z, 1e3 * seconds)


def _rooms(experiment: Experiment, lam: float) -> Iterator[Photograph]:
    height, width = experiment.effort.shape
    scene = Scene(width, height, lam, NOISE)
    for frame in range(0, TURN, TURN // (FRAMES_A_VIEW * experiment.effort.viewpoints)):
        yield Photograph('room', scene.image(frame), FOCAL * scene.lens.half_diagonal, _up(frame))


def _up(frame: int) -> np.ndarray:
    """Return up in the optical frame of the room's camera: (3,)."""
    return viewpoint(frame / TURN)[1][:, 2]


def _photographs(folder: Path) -> dict[str, list[Photograph]]:
    """Return the photographs of a folder by level; README.md has its format."""
    found: dict[str, list[Photograph]] = {}
    for entry in json.loads((folder / TRUTH).read_text(encoding='utf-8')):
        gray = cv2.imread(str(folder / entry['image']), cv2.IMREAD_GRAYSCALE)
        assert gray is not None, f'{folder / entry["image"]}: must be an image'
        found.setdefault(entry['level'], []).append(
            Photograph(entry['level'], gray, entry['focal'], np.array(entry['up'])))
    return found


def _row(name: str, measured: Iterable[Measured]) -> list[object]:
    columns = np.array(list(measured)).T
    focal, focal_z, up, up_z = (column[np.isfinite(column)] for column in columns[:4])
    count = columns.shape[1]
    bias = 100 * float(focal.mean()) if len(focal) else math.nan
    return [name, count, number(len(focal) / count, 2), number(len(up) / count, 2),
            _spread(np.abs(np.expm1(focal)), focal_z), number(bias, 2), _spread(up, up_z),
            number(float(np.median(columns[4])), 2)]


def _spread(errors: np.ndarray, normalised: np.ndarray) -> str:
    if not len(errors):
        return '-'
    return (f'{np.median(errors):.3f} / {np.percentile(errors, 90):.3f} / '
            f'{np.sqrt(np.mean(normalised ** 2)):.2f}')


def _live(lam: float, shape: tuple[int, int], frames: int) -> list[str]:
    """Follow the camera in the room, and then let it stand still."""
    scene, tracker, lenses = Scene(shape[1], shape[0], lam, NOISE), Tracker(), LensTracker()
    attitudes, seconds, ups = AttitudeTracker(), [], []
    before: dict[int, int] = {}
    changed = count = 0
    for frame in range(frames):
        arcs = tracker.track(scene.image(frame))
        lenses.add(arcs, shape)
        took, found = run(attitudes.add, arcs, shape, lenses.estimate)
        seconds.append(took)
        if found is None:
            continue
        ups.append(_angle(found.directions[0], _up(frame)))
        now = dict(zip(arcs.table['track'].tolist(), found.labels.tolist()))
        common = now.keys() & before.keys()
        count, changed = count + len(common), changed + sum(now[k] != before[k] for k in common)
        before = now
    focal = attitudes.focal
    off = abs(focal[0] / (FOCAL * scene.lens.half_diagonal) - 1) if focal else math.nan
    return [number(100 * off, 2), number(float(np.median(ups)) if ups else math.nan),
            number(1e3 * float(np.mean(seconds)), 2), number(100 * changed / max(count, 1), 2),
            *_still(scene, frames, tracker, attitudes, lenses)]


def _still(scene: Scene, frames: int, tracker: Tracker, attitudes: AttitudeTracker,
           lenses: LensTracker) -> list[str]:
    """Return the noise of heading and up of a camera that has stopped, degrees."""
    clean = Scene(*scene.lens.shape[::-1], scene.lens.lam, 0.0).image(frames).astype(np.float32)
    random, axes = np.random.default_rng(0), []
    for _ in range(frames):
        gray = np.clip(np.rint(clean + random.normal(0, NOISE, clean.shape)), 0, 255)
        arcs = tracker.track(gray.astype(np.uint8))
        lenses.add(arcs, scene.lens.shape)
        found = attitudes.add(arcs, scene.lens.shape, lenses.estimate)
        if found is not None:
            axes.append(found.directions[:2])
    return [number(_noise(np.array([pair[k] for pair in axes])), 3) if axes else '-'
            for k in (1, 0)]


def _noise(directions: np.ndarray) -> float:
    """Return the rms angle of directions, (N, 3), to their mean in one of two planes, degrees."""
    off = directions - directions.mean(axis=0)
    return math.degrees(math.sqrt((off ** 2).sum(axis=1).mean() / 2))


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    return math.degrees(math.acos(min(max(float(one @ other), -1.0), 1.0)))
