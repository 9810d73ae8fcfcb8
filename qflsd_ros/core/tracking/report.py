"""The tracks of a frame as arcs."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core import arcs as columns
from qflsd_ros.core.arcs import Arcs, TABLE, TRACKED_TABLE
from qflsd_ros.core.circle import NOISE_FLOOR
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.region import is_open, Region, SAMPLED
from qflsd_ros.core.tracking import curve, state

# Variance of the offset at the middle and of the bend of a parabola over -1 to 1, fitted to n
# points, times n: 9 / 4 and 45 / 4.
OFFSET_LEVER, BEND_LEVER = 2.25, 11.25
MARKS = state.IDENTITY, state.AGE, state.HELD
# A row of the table in two parts: the columns of a detector as one, and those of a tracker.
_PARTS = np.dtype([('plain', np.void, TABLE.itemsize),
                   *((name, TRACKED_TABLE[name]) for name in ('track', 'age', 'held'))])


class Memory(NamedTuple):
    """Memory for the reported tracks."""

    table: np.ndarray       # (MOST, arcs.COLUMNS) float64, their columns
    counts: np.ndarray      # (MOST, arcs.COLUMNS) int64, the same memory, for integers
    chosen: np.ndarray      # (MOST,) int64, their numbers
    marks: np.ndarray       # (3, MOST) int64, their identity, age and whether they are held
    offsets: np.ndarray     # (MOST + 1,) int64: where the edge points of each begin


def memory() -> Memory:
    """Return memory for the reported tracks."""
    table = np.zeros((state.MOST, columns.COLUMNS))
    return Memory(table, table.view(np.int64), np.empty(state.MOST, np.int64),
                  np.empty((3, state.MOST), np.int64), np.zeros(state.MOST + 1, np.int64))


@inlined
def _is_shown(region: Region, x: float, y: float) -> bool:
    """Return whether a point lies in the image, and SAMPLED / 2 or more from masked pixels."""
    height, width = region.allowed.shape
    inside = -0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5
    return inside and (not region.masked or is_open(region.allowed, x, y))


@inlined
def _is_within(region: Region, arc: curve.Curve, first: float, last: float) -> bool:
    """Return whether a part of an arc keeps the arc's sagitta from the image's border."""
    height, width = region.allowed.shape
    margin = abs(arc[5])
    for share in (first, (first + last) / 2, last):
        x, y, _, _ = curve.at(arc, share)
        if not (margin <= x <= width - 1 - margin and margin <= y <= height - 1 - margin):
            return False
    return True


@inlined
def _clip(region: Region, arc: curve.Curve, first: float, last: float) -> tuple[float, float]:
    """Return begin and end of the longest part in sight between two positions (-1 to 1)."""
    if not region.masked and _is_within(region, arc, first, last):
        return first, last
    half = (last - first) / 2
    steps = max(int(math.ceil(curve.length(arc) * half / SAMPLED)), 1)
    best_first, best_last, begin = 0, -1, 0
    for j in range(steps + 1):
        x, y, _, _ = curve.at(arc, first + 2 * half * j / steps)
        if not _is_shown(region, x, y):
            begin = j + 1
        elif j - begin > best_last - best_first:
            best_first, best_last = begin, j
    return first + 2 * half * best_first / steps, first + 2 * half * best_last / steps


@inlined
def _fill(row: np.ndarray, arc: curve.Curve, memory: Memory, k: int) -> None:
    """Fill the columns of row k of the table, but for its three points, with those of a track."""
    table, counts = memory.table, memory.counts
    part = curve.curve(table, k)
    table[k, columns.CURVATURE] = -part[6] if part[6] != 0.0 else 0.0
    table[k, columns.LENGTH] = curve.length(part)
    table[k, columns.RMS] = row[state.RMS]
    deviation = max(row[state.RMS], NOISE_FLOOR) / math.sqrt(row[state.EDGES])
    table[k, columns.OFFSET_STD] = math.sqrt(OFFSET_LEVER) * deviation
    table[k, columns.CURVATURE_STD] = 2 * math.sqrt(BEND_LEVER) * deviation / (arc[4] * arc[4])
    table[k, columns.SCORE], table[k, columns.CONTRAST] = row[state.SCORE], row[state.CONTRAST]
    table[k, columns.POLARITY] = row[state.POLARITY]
    counts[k, columns.SUPPORT], counts[k, columns.BENT] = int(row[state.EDGES]), 1


@compiled
def _select(region: Region, rows: np.ndarray, min_length: float, memory: Memory) -> int:
    """
    Write the reported tracks whose part in sight is long enough to memory; return their number.

    This image is counted in their age.
    """
    n = 0
    for i in range(len(rows)):
        if not rows[i, state.REPORTED]:
            continue
        arc = curve.curve(rows, i)
        first, last = _clip(region, arc, rows[i, state.FIRST], rows[i, state.LAST])
        for column, share in ((columns.START, first), (columns.MIDDLE, (first + last) / 2),
                              (columns.END, last)):
            memory.table[n, column], memory.table[n, column + 1], _, _ = curve.at(arc, share)
        _fill(rows[i], arc, memory, n)
        if last > first and memory.table[n, columns.LENGTH] >= min_length:
            rows[i, state.AGE] += 1
            memory.chosen[n] = i
            for k, column in enumerate(MARKS):
                memory.marks[k, n] = int(rows[i, column])
            memory.offsets[n + 1] = memory.offsets[n] + memory.counts[n, columns.SUPPORT]
            n += 1
    return n


@compiled
def _gather(points: np.ndarray, memory: Memory, n: int, edge_points: np.ndarray,
            edge_pixels: np.ndarray) -> None:
    """Copy the edge points of the first n reported tracks, and round them to pixels."""
    for k in range(n):
        first = memory.offsets[k]
        for j in range(memory.offsets[k + 1] - first):
            for axis in range(2):
                value = points[memory.chosen[k], j, axis]
                edge_points[first + j, axis] = value
                edge_pixels[first + j, axis] = int(np.rint(value))


def arcs(region: Region, rows: np.ndarray, points: np.ndarray, min_length: float,
         memory: Memory) -> Arcs:
    """
    Return the reported tracks as arcs, and count this image in their age.

    Parameters
    ----------
    region
        Of the image.
    rows
        (M, state.COLUMNS) float64, the tracks.
    points
        (M or more, N, 2) float64, the edges that support each track, px.
    min_length
        Tracks whose part in sight is shorter are left out, px.
    memory
        Scratch.

    Returns
    -------
    Arcs with a table of dtype :data:`arcs.TRACKED_TABLE`, in the order of the rows.

    """
    n = _select(region, rows, min_length, memory)
    offsets = memory.offsets[:n + 1].copy()
    edge_points = np.empty((offsets[n], 2))
    edge_pixels = np.empty((offsets[n], 2), np.int32)
    _gather(points, memory, n, edge_points, edge_pixels)
    table = np.empty(n, TRACKED_TABLE)
    parts = table.view(_PARTS)
    parts['plain'] = memory.table[:n].view(_PARTS['plain'])[:, 0]
    parts['track'], parts['age'], parts['held'] = memory.marks[:, :n]
    return Arcs(table, edge_points, edge_pixels, offsets)


def none() -> Arcs:
    """Return the result for an image without tracks."""
    return Arcs(np.zeros(0, TRACKED_TABLE), np.zeros((0, 2)), np.zeros((0, 2), np.int32),
                np.zeros(1, np.int64))
