"""
A chart of the image: which track passes through a pixel.

Tracks are entered one by one; of two that lie on each other the first remains.  So it takes the
same time to find what lies beside an arc however many tracks there are.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.suppression import HIDDEN, PARALLEL
from qflsd_ros.core.tracking import curve
from qflsd_ros.core.tracking.union import lengthen

NOBODY = -1         # on a pixel
BESIDE = 2          # px across, that a track takes on either side
EVERY = 3.0         # px between places of an arc that are looked at
SHARED = 3          # such places that two tracks on one curve share, to become one


@compiled
def enter(chart: np.ndarray, rows: np.ndarray, i: int) -> None:
    """Enter a track into the pixels that are free."""
    height, width = chart.shape
    arc = curve.curve(rows, i)
    steps = int(math.ceil(curve.length(arc)))
    for j in range(steps + 1):
        x, y, nx, ny = curve.at(arc, 2 * j / max(steps, 1) - 1)
        column, row = int(math.floor(x + 0.5)), int(math.floor(y + 0.5))
        across_x = abs(nx) >= abs(ny)
        for k in range(-BESIDE, BESIDE + 1):
            u, v = (column + k, row) if across_x else (column, row + k)
            if 0 <= u < width and 0 <= v < height and chart[v, u] == NOBODY:
                chart[v, u] = i


@inlined
def owner(chart: np.ndarray, rows: np.ndarray, x: float, y: float, nx: float, ny: float,
          distance: float) -> tuple[int, float]:
    """
    Return the track on which a point of an arc with the normal (nx, ny) lies, or NOBODY.

    The second number is the cosine between both normals: below 0 where the other side is brighter.
    """
    height, width = chart.shape
    column, row = int(math.floor(x + 0.5)), int(math.floor(y + 0.5))
    if not (0 <= column < width and 0 <= row < height) or chart[row, column] == NOBODY:
        return NOBODY, 0.0
    track = int(chart[row, column])
    arc = curve.curve(rows, track)
    share, off = curve.place(arc, x, y)
    _, _, mx, my = curve.at(arc, min(max(share, -1.0), 1.0))
    if abs(off) > distance or abs(nx * my - ny * mx) > PARALLEL:
        return NOBODY, 0.0
    return track, nx * mx + ny * my


@compiled
def enter_all(chart: np.ndarray, rows: np.ndarray, order: np.ndarray, distance: float,
              hidden: np.ndarray, absorbed: np.ndarray) -> None:
    """
    Enter tracks in order, but those that for the most part lie on others already entered.

    Those that lie on one curve with another, and overlap it, become a part of it.

    Parameters
    ----------
    chart
        (H, W) int16.
    rows
        (M, COLUMNS) float64, the tracks.
    order
        (N,) int64, those to enter.
    distance
        Up to which one lies on another, px.
    hidden, absorbed
        (M,) bool, take True for those left out, and for those that are a part of another now.

    """
    for i in order:
        arc = curve.curve(rows, i)
        steps = max(int(math.ceil(curve.length(arc) / EVERY)), 1)
        on_others, last, on_last = 0, NOBODY, 0
        for j in range(steps + 1):
            x, y, nx, ny = curve.at(arc, 2 * j / steps - 1)
            track, cosine = owner(chart, rows, x, y, nx, ny, distance)
            if track == NOBODY:
                continue
            on_others += 1
            if cosine > 0:
                on_last = on_last + 1 if track == last else 1
                last = track
        hidden[i] = on_others >= HIDDEN * (steps + 1)
        if not hidden[i] and on_last >= SHARED and lengthen(rows, last, rows, i, True):
            hidden[i] = absorbed[i] = True
            enter(chart, rows, last)
        if not hidden[i]:
            enter(chart, rows, i)
