"""What a score promises in images of noise alone, and how many arcs there are."""
from __future__ import annotations

from benchmark import plots
from benchmark.experiment import Experiment
from benchmark.report import number, picture, section, table
import cv2
import numpy as np
from qflsd_ros.core import Detector, Parameters

GRAINS = 0.0, 1.0, 2.0, 4.0     # px, standard deviation of the blur of the noise; 0 is white
LEVELS = 3.0, 10.0, 30.0        # grey levels, its standard deviation
SCORES = 0, 1, 2, 3, 4, 6, 8, 10
SHAPE = 480, 640
IMAGES = 4              # of each kind, for each round of the effort
PROMISED = 'promised'


def image(grain: float, level: float, seed: int) -> np.ndarray:
    """Return an image of noise, (H, W) uint8."""
    noise = np.random.default_rng(seed).normal(0, 1, SHAPE)
    if grain > 0:
        noise = np.asarray(cv2.GaussianBlur(noise, (0, 0), grain), float)
    return np.clip(np.round(128 + level * noise / noise.std()), 0, 255).astype(np.uint8)


def counted(grain: float, level: float, images: int) -> list[float]:
    """Return the mean number of arcs of an image that have at least each of the scores."""
    detector = Detector(Parameters(min_score=float(min(SCORES))))
    scores = np.concatenate([detector.detect(image(grain, level, seed)).table['score']
                             for seed in range(images)])
    return [np.count_nonzero(scores >= least) / images for least in SCORES]


def measure(experiment: Experiment) -> str:
    """Return the section on false alarms."""
    images = IMAGES * experiment.effort.rounds
    promised = [10.0 ** -score for score in SCORES]
    found = {(grain, level): counted(grain, level, images)
             for grain in GRAINS for level in LEVELS}
    panels = [plots.Panel(
        'White noise' if grain == 0 else f'Noise of {grain:g} px', 'score', 'arcs an image',
        {PROMISED: (SCORES, promised)} | {
            f'{level:g} grey levels': _above_zero(found[grain, level]) for level in LEVELS},
        logarithmic='y', limits=(1 / (2 * images), 100)) for grain in GRAINS]
    path = experiment.figures / 'false_alarms.png'
    plots.save(path, panels, columns=2)
    height, width = SHAPE
    return section(
        'False alarms',
        f'Arcs in {images} images of noise alone, {width}x{height} px, by their least score, and '
        'what the score would promise were edge points independent of each other.',
        table(('noise: blur, grey levels', *map(str, SCORES)), [
            (PROMISED, *(f'{rate:.0e}' for rate in promised)),
            *((f'{grain:g} px, {level:g}', *(number(count, 2) for count in counts))
              for (grain, level), counts in found.items())]),
        picture(path, experiment.output, 'False alarms promised and counted'))


def _above_zero(counts: list[float]) -> tuple[list[float], list[float]]:
    """Return scores and counts as far as there are any, for a logarithmic axis."""
    pairs = [(score, count) for score, count in zip(SCORES, counts) if count > 0]
    return [float(score) for score, _ in pairs], [count for _, count in pairs]
