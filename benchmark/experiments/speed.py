"""Time against resolution, edge density and number of arcs, on rendered scenes."""
from __future__ import annotations

from benchmark import plots, timing
from benchmark.experiment import Experiment
from benchmark.peers import FLOOR, LSD, OURS, TITLES
from benchmark.report import picture, section, significant, table
from benchmark.scenes import planes
from benchmark.scenes.rendered import room
import cv2
import numpy as np
from qflsd_ros.core import DivisionModel
from tqdm import tqdm

LAM = -0.25
SIZES = (320, 240), (640, 480), (960, 720), (1280, 960), (1920, 1080)       # width, height
CELLS = 1.0, 0.5, 0.3, 0.2, 0.15, 0.11, 0.085        # half diagonals, of the bars


def measure(experiment: Experiment) -> str:
    """Write the section."""
    effort = experiment.effort
    names = (*experiment.peers, FLOOR)
    sizes = {f'{width}x{height}': room(0, LAM, (height, width)).gray
             for width, height in tqdm(SIZES[:len(SIZES) - effort.every + 1], 'scenes by size')}
    cells = {f'cells of {cell:g}': _bars(cell, effort.shape)
             for cell in tqdm(CELLS[::effort.every], 'scenes by density')}
    of_sizes = timing.measure(sizes, names, effort.rounds, 'speed by size')
    of_cells = timing.measure(cells, names, effort.rounds, 'speed by density')
    path = experiment.figures / 'speed.png'
    plots.save(path, [
        _panel('A room at several sizes', 'Mpx', {
            name: gray.size / 1e6 for name, gray in sizes.items()}, of_sizes, 'xy'),
        _panel(f'Bars, {effort.shape[1]}x{effort.shape[0]}', 'edge pixels, %', {
            name: 100 * _density(gray) for name, gray in cells.items()}, of_cells),
        _panel('The same bars', 'segments or arcs found', None, of_cells)])
    return section(
        'Speed', 'CPU time, one thread, medians; ratios are geometric means over the images, '
        'above 1 where ours is faster.', _table(names, sizes, of_sizes, of_cells),
        picture(path, experiment.output, 'Speed against size, edge density and number found'))


def _bars(cell: float, shape: tuple[int, int]) -> np.ndarray:
    lens = DivisionModel(LAM, shape)
    return planes.render(planes.bars(lens, cell), lens, 2.0)


def _density(gray: np.ndarray) -> float:
    """Return the share of edge pixels."""
    return float((cv2.Canny(cv2.GaussianBlur(gray, (5, 5), 0), 50, 150) > 0).mean())


def _panel(title: str, x: str, at: dict[str, float] | None, timings: timing.Timings,
           logarithmic: str = 'y') -> plots.Panel:
    """Return times against ``at``, or where that is None, against the number found."""
    names = next(iter(timings.values()))
    shown = [name for name in names if at is not None or name != FLOOR]
    return plots.Panel(title, x, 'CPU time, ms', {
        name: ([timings[image][name].count if at is None else at[image] for image in timings],
               [row[name].ms for row in timings.values()]) for name in shown},
        dots=at is None, logarithmic=logarithmic)


def _table(names: tuple[str, ...], sizes: dict[str, np.ndarray], of_sizes: timing.Timings,
           of_cells: timing.Timings) -> str:
    rows = [(TITLES.get(name, name), *(significant(of_sizes[size][name].ms) for size in sizes),
             significant(timing.ratio(of_sizes, name, OURS)),
             significant(timing.ratio(of_cells, name, OURS)),
             significant(timing.ratio(of_sizes, name, LSD))) for name in names]
    return table(('detector', *(f'{size}, ms' for size in sizes), 'over ours, by size',
                  'over ours, by density', 'over LSD, by size'), rows)
