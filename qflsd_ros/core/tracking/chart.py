"""
The chart: an index image, in which each pixel holds the number of the closest track.

Tracks are entered one by one; of two tracks that cover a pixel, it keeps the closer one, so that
both sides of a thin line are found.  A look-up of the track beside a point takes the same time
however many tracks there are.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.suppression import HIDDEN, PARALLEL
from qflsd_ros.core.tracking import curve
from qflsd_ros.core.tracking.state import MOST
from qflsd_ros.core.tracking.union import APART, lengthen

NOBODY = -1         # a pixel without a track
BESIDE = 2          # px on either side that a track covers; chosen, not tuned
EVERY = 3.0         # px between the sampled points of an arc; chosen, not tuned
# Successive sampled points on one other track from which on both are merged; chosen, not tuned.
SHARED = 3


class Chart(NamedTuple):
    """The tracks that have been entered, by place and by number."""

    pixels: np.ndarray      # (H, W) int16, number of the closest track, or NOBODY
    curves: np.ndarray      # (MOST, 7) float64, the curve of each track


def empty(shape: tuple[int, int]) -> Chart:
    """Return a chart without tracks for images of a shape (height, width)."""
    return Chart(np.full(shape, NOBODY, np.int16), np.empty((MOST, curve.NUMBERS)))


@inlined
def _curve(chart: Chart, i: int) -> curve.Curve:
    """Return the curve of an entered track."""
    c = chart.curves[i]
    return c[0], c[1], c[2], c[3], c[4], c[5], c[6]


@inlined
def _is_closer(chart: Chart, other: int, u: int, v: int, distance: float) -> bool:
    """Return whether a distance, px, is smaller than that of another track from a pixel."""
    _, off = curve.place(_curve(chart, other), u, v)
    return distance < abs(off)


@compiled
def enter(chart: Chart, rows: np.ndarray, i: int) -> None:
    """Write the number i of a track to the pixels that it covers, where no other is closer."""
    height, width = chart.pixels.shape
    arc = curve.curve(rows, i)
    chart.curves[i] = arc
    steps = int(math.ceil(curve.length(arc)))
    for j in range(steps + 1):
        x, y, nx, ny = curve.at(arc, 2 * j / max(steps, 1) - 1)
        column, row = int(math.floor(x + 0.5)), int(math.floor(y + 0.5))
        across_x = abs(nx) >= abs(ny)
        for k in range(-BESIDE, BESIDE + 1):
            u, v = (column + k, row) if across_x else (column, row + k)
            if not (0 <= u < width and 0 <= v < height) or chart.pixels[v, u] == i:
                continue
            other = int(chart.pixels[v, u])
            if other == NOBODY or _is_closer(chart, other, u, v,
                                             abs((u - x) * nx + (v - y) * ny)):
                chart.pixels[v, u] = i


@inlined
def owner(chart: Chart, x: float, y: float, nx: float, ny: float,
          distance: float) -> tuple[int, float]:
    """
    Return the track within ``distance`` px of a point, and parallel to it, or NOBODY.

    The point has the normal (nx, ny).  The second number is the cosine between this normal and
    that of the track: below 0 if their brighter sides are opposite.
    """
    height, width = chart.pixels.shape
    column, row = int(math.floor(x + 0.5)), int(math.floor(y + 0.5))
    if not (0 <= column < width and 0 <= row < height) or chart.pixels[row, column] == NOBODY:
        return NOBODY, 0.0
    track = int(chart.pixels[row, column])
    arc = _curve(chart, track)
    share, off = curve.place(arc, x, y)
    _, _, mx, my = curve.at(arc, min(max(share, -1.0), 1.0))
    if abs(off) > distance or abs(nx * my - ny * mx) > PARALLEL:
        return NOBODY, 0.0
    return track, nx * mx + ny * my


@compiled
def enter_all(chart: Chart, rows: np.ndarray, order: np.ndarray, distance: float,
              hidden: np.ndarray, absorbed: np.ndarray) -> None:
    """
    Enter tracks in order, except for those hidden by tracks that were entered before.

    A track is hidden if the share HIDDEN of its points lies on others.  One that overlaps a track
    less than that, on the same curve, is merged into it.

    Parameters
    ----------
    chart
        Without tracks before the call.
    rows
        (M, COLUMNS) float64, the tracks.
    order
        (N,) int64, the tracks to enter.
    distance
        Largest distance of a point that lies on another track, px.
    hidden, absorbed
        (M,) bool, receive True for tracks that are not entered, and of these for merged ones.

    """
    for i in order:
        arc = curve.curve(rows, i)
        steps = max(int(math.ceil(curve.length(arc) / EVERY)), 1)
        on_others, last, on_last = 0, NOBODY, 0
        for j in range(steps + 1):
            x, y, nx, ny = curve.at(arc, 2 * j / steps - 1)
            track, cosine = owner(chart, x, y, nx, ny, distance)
            if track == NOBODY:
                continue
            on_others += 1
            if cosine > 0:
                on_last = on_last + 1 if track == last else 1
                last = track
        hidden[i] = on_others >= HIDDEN * (steps + 1)
        if not hidden[i] and on_last >= SHARED and lengthen(rows, last, rows, i, True) != APART:
            hidden[i] = absorbed[i] = True
            enter(chart, rows, last)
        if not hidden[i]:
            enter(chart, rows, i)
