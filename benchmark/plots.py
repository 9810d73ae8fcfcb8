"""Plots, all in one style: panels side by side, every detector in its own colour."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmark.peers import TITLES
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

COLOURS = {'qflsd': '#d62728', 'paper': '#9467bd', 'lsd': '#1f77b4', 'pytlsd': '#17becf',
           'lsdetect': '#7f7f7f', 'fld': '#2ca02c', 'edlines': '#ff7f0e', 'canny': '#bcbd22'}
PANEL = 4.2, 3.4        # inches
DPI = 80
Values = Sequence[float] | np.ndarray


@dataclass(frozen=True)
class Panel:
    """
    One diagram.

    Attributes
    ----------
    series
        x and y by the name of the detector.
    dots
        Whether points are left unconnected; single ones always are.
    logarithmic
        The axes that are: '', 'y' or 'xy'.

    """

    title: str
    x: str
    y: str
    series: Mapping[str, tuple[Values, Values]]
    dots: bool = False
    logarithmic: str = ''
    limits: tuple[float, float] | None = None       # of y


def save(path: Path, panels: Sequence[Panel], columns: int = 3) -> None:
    """Write panels as one PNG."""
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure((PANEL[0] * columns, PANEL[1] * rows), DPI, layout='constrained')
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, panel in zip(axes, panels):
        _draw(axis, panel)
    for axis in axes[len(panels):]:
        axis.remove()
    handles = {label: handle for axis in axes[:len(panels)]
               for handle, label in zip(*axis.get_legend_handles_labels())}
    figure.legend(handles.values(), handles.keys(), loc='outside lower center',
                  ncols=min(3, 2 * columns), frameon=False, fontsize=9)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def _draw(axis: Axes, panel: Panel) -> None:
    for name, (x, y) in panel.series.items():
        style = 'o' if panel.dots or len(x) == 1 else '.-'
        order = np.argsort(x, kind='stable') if panel.dots else slice(None)
        axis.plot(np.asarray(x, float)[order], np.asarray(y, float)[order], style,
                  color=COLOURS.get(name), label=TITLES.get(name, name),
                  markersize=4 if panel.dots else 6)
    for direction in panel.logarithmic:
        axis.set(**{f'{direction}scale': 'log'})
    if panel.limits is not None:
        axis.set_ylim(panel.limits)
    axis.set_title(panel.title, fontsize=10)
    axis.set_xlabel(panel.x, fontsize=9)
    axis.set_ylabel(panel.y, fontsize=9)
    axis.tick_params(labelsize=8)
    axis.grid(alpha=0.3)
