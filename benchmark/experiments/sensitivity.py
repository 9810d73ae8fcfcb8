"""
Sensitivity of the results to the detector's constants: each is varied by 30 %, the others kept.

Accuracy is measured on annotated images, repeatability on two second views of each: one under
other light, one under a homography.
"""
from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

from benchmark.constants import Constant
from benchmark.datasets import LENSES, View
from benchmark.experiment import Experiment
from benchmark.metrics import Comparison, Counts, sample
from benchmark.parallel import each
from benchmark.peers import TOLERANCE
from benchmark.report import number, section, table
from benchmark.variation import change, NOT_VARIED, varied
import cv2
import numpy as np
from qflsd_ros.core import Detector

TITLE = 'Sensitivity to constants'
FACTORS = 0.7, 1.3
MIN_LENGTH = 20.0           # px, of annotated lines, and of arcs that are to be found again
GAIN, OFFSET, NOISE = 0.8, 10.0, 3.0        # of a second view; the last two in grey levels
MOVED = 0.06                # share of the sides by which the corners of a view move at most
BORDER = 6.0                # px inside the second view, from where arcs are to be found again
EXPLANATION = (
    'Change of F and whole (at 2 px and 5 degrees), and of again, in hundredths, when one '
    'constant '
    'is varied by -30 % / +30 % and all others are kept; of an angle of which the code uses a '
    'sine '
    'or cosine, the angle is varied; whole numbers are rounded. *again*: share, by length, of the '
    f'arcs of {MIN_LENGTH:g} px or more that are found again within 2 px and 5 degrees in a '
    'second '
    f'view of the same image: the mean over one with gain {GAIN:g}, offset {OFFSET:g} and noise '
    f'{NOISE:g} grey levels, and one under a homography that moves the corners by up to '
    f'{100 * MOVED:g} % of the sides.')


class Task(NamedTuple):
    """A variation of a constant, or None for the detector as it is, and the images."""

    constant: Constant | None
    factor: float
    views: list[View]


class Result(NamedTuple):
    """The figures of a variation, as shares."""

    f_measure: float
    whole: float
    again: float


def run(task: Task) -> Result:
    """Vary a constant in this process, which must not have detected anything yet, and measure."""
    cv2.setNumThreads(1)
    if task.constant is not None:
        change(task.constant, task.factor)
    detector = Detector()
    truth, light, plane = Counts(), Counts(), Counts()
    for i, view in enumerate(task.views):
        gray = view.gray
        arcs = detector.detect(gray).polylines(TOLERANCE)
        truth += Comparison(sample(arcs), sample(view.lines)).count(min_truth=MIN_LENGTH)
        light += found_again(detector, gray, arcs, np.eye(3), i)
        plane += found_again(detector, gray, arcs, homography(gray.shape, i), i)
    figures = truth.figures()
    return Result(figures.f_measure, figures.whole,
                  (light.figures().recall + plane.figures().recall) / 2)


def homography(shape: Sequence[int], seed: int) -> np.ndarray:
    """Return a (3, 3) homography of (height, width) px that moves each corner at random."""
    height, width = shape
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    moves = np.random.default_rng(seed).uniform(-MOVED, MOVED, (4, 2)) * (width, height)
    return cv2.getPerspectiveTransform(corners, (corners + moves).astype(np.float32))


def second_view(gray: np.ndarray, there: np.ndarray, seed: int) -> np.ndarray:
    """Return an image (H, W) uint8 under a homography and other light."""
    moved = cv2.warpPerspective(gray, there, gray.shape[::-1], flags=cv2.INTER_CUBIC,
                                borderMode=cv2.BORDER_REPLICATE)
    noise = np.random.default_rng(seed).normal(0, NOISE, gray.shape)
    return np.clip(np.rint(GAIN * moved + OFFSET + noise), 0, 255).astype(np.uint8)


def found_again(detector: Detector, gray: np.ndarray, arcs: list[np.ndarray], there: np.ndarray,
                seed: int) -> Counts:
    """Compare arcs, as (K, 2) px polylines, with those of a second view, brought back."""
    back = np.linalg.inv(there)
    second = detector.detect(second_view(gray, there, seed)).polylines(TOLERANCE)
    height, width = gray.shape
    left, top, right, bottom = BORDER, BORDER, width - 1 - BORDER, height - 1 - BORDER
    outline = moved(np.array([[left, top], [right, top], [right, bottom], [left, bottom]]), back)
    in_sight = sample(arcs).inside(outline)
    return Comparison(sample(moved(line, back) for line in second), in_sight).count(
        min_truth=MIN_LENGTH)


def moved(points: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Return points (N, 2) px under a homography (3, 3)."""
    return cv2.perspectiveTransform(points.reshape(1, -1, 2).astype(float), by)[0]


def measure(experiment: Experiment) -> str:
    """Write the section."""
    views = [view for lens in LENSES
             for view in experiment.dataset.of_lens(lens, experiment.effort.per_lens // 2)]
    chosen = varied()[::experiment.effort.every]
    tasks = [Task(None, 1.0, views)]
    tasks += [Task(constant, factor, views) for constant in chosen for factor in FACTORS]
    # Each in a process of its own: constants are compiled into the kernels.
    (_, usual), *others = each(run, tasks, 'sensitivity', fresh=True)
    results = [result for _, result in others]
    rows = [(f'`{constant.title}`', f'`{constant.source}`', *cells(usual, *pair))
            for constant, pair in zip(chosen, zip(results[::2], results[1::2]))]
    left_out = '; '.join(f'{reason}: {", ".join(f"`{title}`" for title in titles)}'
                         for reason, titles in NOT_VARIED.items())
    return section(
        TITLE, EXPLANATION,
        f'{len(views)} images; with all constants as they are F is {number(usual.f_measure)}, '
        f'whole {number(usual.whole)}, again {number(usual.again)}.',
        table(('constant', 'value', 'F', 'whole', 'again'), rows),
        f'Not varied are constants of these kinds: {left_out}.')


def cells(usual: Result, smaller: Result, larger: Result) -> list[str]:
    """Return the changes of all figures, in hundredths."""
    return [f'{hundredths(low - now)} / {hundredths(high - now)}'
            for now, low, high in zip(usual, smaller, larger)]


def hundredths(change_: float) -> str:
    """Return a signed change in hundredths, 0.0 without a sign, - for nan."""
    if math.isnan(change_):
        return '-'
    rounded = round(100 * change_, 1)
    return f'{rounded:+.1f}' if rounded else '0.0'
