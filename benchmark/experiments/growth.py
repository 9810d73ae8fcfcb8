"""Growth of time with the number of pixels and of edge pixels, from 640x480 to 3840x2160."""
from __future__ import annotations

from collections.abc import Sequence

from benchmark import plots, timing
from benchmark.experiment import Experiment
from benchmark.peers import EDLINES, FLOOR, LSD, OURS, TITLES
from benchmark.report import number, picture, section, significant, table
from benchmark.scenes import planes
from benchmark.scenes.rendered import room
import cv2
import numpy as np
from qflsd_ros.core import DivisionModel

SIZES = (640, 480), (1280, 720), (1920, 1080), (2560, 1440), (3840, 2160)   # width, height
CELLS = 0.5, 0.25, 0.12, 0.06, 0.03         # half diagonals, of the bars
LAM = -0.25
MOST = 1.1              # largest slope of growth that is called linear


def tiled(size: tuple[int, int]) -> np.ndarray:
    """Return copies of a room side by side, (H, W) uint8: the density of edges stays the same."""
    width, height = size
    gray = room(0, LAM, SIZES[0][::-1]).gray
    times = -(-height // gray.shape[0]), -(-width // gray.shape[1])
    return np.tile(gray, times)[:height, :width]


def bars(cell: float, shape: tuple[int, int]) -> np.ndarray:
    """Return an image (H, W) uint8 of bars; smaller cells give more edge pixels."""
    lens = DivisionModel(LAM, shape)
    return planes.render(planes.bars(lens, cell), lens, 2.0)


def edge_pixels(gray: np.ndarray) -> int:
    """Return the number of edge pixels by Canny's operator."""
    return int(np.count_nonzero(cv2.Canny(cv2.GaussianBlur(gray, (5, 5), 0), 50, 150)))


def slope(at: Sequence[float], timings: timing.Timings, name: str) -> float:
    """Return the exponent of the power law that fits the times best."""
    return float(np.polyfit(np.log(at), np.log([row[name].ms for row in timings.values()]), 1)[0])


def measure(experiment: Experiment) -> str:
    """Write the section."""
    effort = experiment.effort
    names = tuple(name for name in (LSD, EDLINES, OURS)
                  if name in experiment.peers) + (FLOOR,)
    sizes = {f'{size[0]}x{size[1]}': tiled(size) for size in SIZES[:len(SIZES) - effort.every + 1]}
    cells = {f'{cell:g}': bars(cell, effort.shape)
             for cell in CELLS[:len(CELLS) - effort.every + 1]}
    of_sizes = timing.measure(sizes, names, effort.rounds, 'growth with pixels')
    of_cells = timing.measure(cells, names, effort.rounds, 'growth with edge pixels')
    pixels = [gray.size for gray in sizes.values()]
    edges = [edge_pixels(gray) for gray in cells.values()]
    path = experiment.figures / 'growth.png'
    plots.save(path, [_panel('pixels', pixels, of_sizes), _panel('edge pixels', edges, of_cells)])
    rows = [(TITLES[name], *(significant(row[name].ms) for row in of_sizes.values()),
             number(slope(pixels, of_sizes, name), 2), number(slope(edges, of_cells, name), 2))
            for name in names]
    reached = all(slope(*of, OURS) <= MOST for of in ((pixels, of_sizes), (edges, of_cells)))
    height, width = effort.shape
    return section(
        'Growth',
        'CPU time, one thread, medians. Pixels: a rendered room, tiled, so that the '
        f'density of edges is the same. Edge pixels: bars of {len(cells)} sizes in '
        f'{width}x{height} px, '
        f'{edges[0]} to {edges[-1]} edge pixels. Slope: the exponent of the power law that fits '
        f'best, 1 where time is proportional. Goal: not above {MOST} for ours, in both; '
        f'reached: {"yes" if reached else "no"}.',
        table(('detector', *(f'{size}, ms' for size in sizes), 'slope over pixels',
               'slope over edge pixels'), rows),
        picture(path, experiment.output, 'Time against pixels and edge pixels'))


def _panel(x: str, at: Sequence[float], timings: timing.Timings) -> plots.Panel:
    names = next(iter(timings.values()))
    return plots.Panel('', x, 'CPU time, ms', {
        name: (at, [row[name].ms for row in timings.values()]) for name in names},
        logarithmic='xy')
