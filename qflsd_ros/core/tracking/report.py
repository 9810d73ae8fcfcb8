"""The tracks of a frame as arcs."""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.arcs import (
    Arcs, BENT, COLUMNS, CONTRAST, CURVATURE, CURVATURE_STD, END, LENGTH, MIDDLE, OFFSET_STD,
    POLARITY, RMS, SCORE, START, SUPPORT, TABLE, TRACKED_TABLE)
from qflsd_ros.core.circle import NOISE_FLOOR
from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.frame import Frame
from qflsd_ros.core.detection.region import is_open, SAMPLED
from qflsd_ros.core.tracking import curve, state

# Variance of the offset at the middle and of the bend of a parabola over -1 to 1, fitted to n
# points, times n: 9 / 4 and 45 / 4.
OFFSET_LEVER, BEND_LEVER = 2.25, 11.25


@inlined
def _is_shown(allowed: np.ndarray, masked: bool, x: float, y: float) -> bool:
    """Return whether a point lies in the image, and SAMPLED / 2 or more from masked pixels."""
    height, width = allowed.shape
    inside = -0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5
    return inside and (not masked or is_open(allowed, x, y))


@inlined
def _is_within(shape: tuple[int, int], rows: np.ndarray, i: int, margin: float) -> bool:
    """Return whether start, middle and end of a track keep a margin to the image's border."""
    for column in (state.START, state.MIDDLE, state.END):
        x, y = rows[i, column], rows[i, column + 1]
        if not (margin <= x <= shape[1] - 1 - margin and margin <= y <= shape[0] - 1 - margin):
            return False
    return True


@compiled
def clip(allowed: np.ndarray, masked: bool, rows: np.ndarray, i: int) -> tuple[float, float]:
    """Return first and last position (-1 to 1) of a track's longest part in sight."""
    arc = curve.curve(rows, i)
    if not masked and _is_within(allowed.shape, rows, i, abs(arc[5])):
        return -1.0, 1.0
    steps = max(int(math.ceil(curve.length(arc) / SAMPLED)), 1)
    best_first, best_last, first = 0, -1, 0
    for j in range(steps + 1):
        x, y, _, _ = curve.at(arc, 2 * j / steps - 1)
        if not _is_shown(allowed, masked, x, y):
            first = j + 1
        elif j - first > best_last - best_first:
            best_first, best_last = first, j
    return 2 * best_first / steps - 1, 2 * best_last / steps - 1


@compiled
def fill(rows: np.ndarray, chosen: np.ndarray, parts: np.ndarray, table: np.ndarray) -> None:
    """
    Fill the columns of :data:`arcs.TABLE` for some tracks.

    Parameters
    ----------
    rows
        (M, COLUMNS) float64, the tracks.
    chosen
        (N,) int64, those to report.
    parts
        (M, 2) float64, positions along the chord (-1 to 1) between which each is reported.
    table
        (N, arcs.COLUMNS) float64, receives the columns.

    """
    for k in range(len(chosen)):
        i = chosen[k]
        arc = curve.curve(rows, i)
        first, last = parts[i, 0], parts[i, 1]
        for column, share in ((START, first), (MIDDLE, (first + last) / 2), (END, last)):
            table[k, column], table[k, column + 1], _, _ = curve.at(arc, share)
        part = curve.curve(table, k)
        table[k, CURVATURE] = -part[6] if part[6] != 0.0 else 0.0
        table[k, LENGTH] = curve.length(part)
        table[k, RMS], table[k, SUPPORT] = rows[i, state.RMS], rows[i, state.EDGES]
        deviation = max(rows[i, state.RMS], NOISE_FLOOR) / math.sqrt(rows[i, state.EDGES])
        table[k, OFFSET_STD] = math.sqrt(OFFSET_LEVER) * deviation
        table[k, CURVATURE_STD] = 2 * math.sqrt(BEND_LEVER) * deviation / (arc[4] * arc[4])
        table[k, SCORE], table[k, CONTRAST] = rows[i, state.SCORE], rows[i, state.CONTRAST]
        table[k, POLARITY], table[k, BENT] = rows[i, state.POLARITY], 1.0


def arcs(rows: np.ndarray, chosen: np.ndarray, parts: np.ndarray, points: np.ndarray,
         min_length: float) -> Arcs:
    """
    Return some tracks as arcs, and count this image in their age.

    Parameters
    ----------
    rows, chosen, parts
        As of :func:`fill`.
    points
        (M, ..., 2) float64, the edges that support each track, px.
    min_length
        Tracks whose part in sight is shorter are left out, px.

    Returns
    -------
    Arcs with a table of dtype :data:`arcs.TRACKED_TABLE`, in the order of ``chosen``.

    """
    filled = np.zeros((len(chosen), COLUMNS))
    fill(rows, chosen, parts, filled)
    is_long = filled[:, LENGTH] >= min_length
    chosen, filled = chosen[is_long], filled[is_long]
    rows[chosen, state.AGE] += 1
    plain = filled.view(TABLE)[:, 0]
    table = np.empty(len(chosen), TRACKED_TABLE)
    for name in TABLE.names or ():
        table[name] = plain[name]
    table['support'], table['bent'] = filled[:, SUPPORT], filled[:, BENT]
    table['track'], table['age'] = rows[chosen, state.IDENTITY], rows[chosen, state.AGE]
    table['held'] = rows[chosen, state.HELD]
    counts = rows[chosen, state.EDGES].astype(np.int64)
    offsets = np.r_[0, np.cumsum(counts)]
    taken = np.arange(points.shape[1]) < counts[:, None]
    edge_points = points[chosen][taken]
    return Arcs(table, edge_points, np.rint(edge_points).astype(np.int32), offsets)


def in_sight(image: Frame, rows: np.ndarray, chosen: np.ndarray,
             parts: np.ndarray) -> None:
    """Write to ``parts`` (M, 2) the supported part in sight of the chosen tracks, -1 to 1."""
    _clip_all(image.region.allowed, image.region.masked, rows, chosen, parts)


@compiled
def _clip_all(allowed: np.ndarray, masked: bool, rows: np.ndarray, chosen: np.ndarray,
              parts: np.ndarray) -> None:
    for i in chosen:
        first, last = clip(allowed, masked, rows, i)
        parts[i, 0] = max(first, rows[i, state.FIRST])
        parts[i, 1] = min(last, rows[i, state.LAST])
