"""The files for one picture: overlay (PNG), table of arcs (CSV), arcs with lens (JSON)."""
from __future__ import annotations

import csv
import io
import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from qflsd_ros.cli.inputs import Picture
from qflsd_ros.cli.output.writing import write_whole
from qflsd_ros.cli.settings import Options
from qflsd_ros.core import Arcs, Attitude, DivisionModel, LensEstimate
from qflsd_ros.ros.attitude import roll_and_pitch

SUFFIXES = ('.png', '.csv', '.json')


def write(folder: Path, room: Path, picture: Picture, drawn: np.ndarray, arcs: Arcs,
          camera: dict[str, Any], options: Options) -> None:
    """
    Write overlay, CSV and JSON of a picture into a folder; each file complete or not at all.

    ``drawn`` is the overlay, (H, W, 3) uint8 B, G, R; ``camera`` has the lens and the attitude.

    Raises
    ------
    OSError
        A file cannot be written.

    """
    contents = (cv2.imencode('.png', drawn)[1].tobytes(), table(arcs).encode(),
                description(picture, drawn.shape[:2], arcs, camera, options).encode())
    for suffix, content in zip(SUFFIXES, contents):
        write_whole(folder, picture.name + suffix, content, room)


def table(arcs: Arcs) -> str:
    """Return the arcs as CSV: a header, then one row per arc; start becomes start_x, start_y."""
    columns = {name: (column.view(np.uint8) if column.dtype == bool else column).tolist()
               for name, column in arcs.columns().items()}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(columns)
    writer.writerows(zip(*columns.values()))
    return text.getvalue()


def description(picture: Picture, shape: tuple[int, int], arcs: Arcs,
                camera: dict[str, Any], options: Options) -> str:
    """Return a picture of a shape (height, width), its camera, parameters and arcs as JSON."""
    names = arcs.table.dtype.names or ()
    columns = [_without_nan(arcs.table[name]).tolist() for name in names]
    polylines = arcs.polylines(options.node.polyline_tolerance)
    return json.dumps({
        'image': str(picture.path),
        'frame': picture.frame,
        'width': shape[1],
        'height': shape[0],
        'parameters': options.values(),
        **camera,
        'arcs': [dict(zip(names, row)) | {'points': points.tolist()}
                 for *row, points in zip(*columns, polylines)],
    })


def _without_nan(column: np.ndarray) -> np.ndarray:
    """Return a column with None, null in JSON, for nan: a value that is unknown."""
    values = column.astype(object)
    values[np.isnan(column)] = None
    return values


def lens(model: DivisionModel | None, estimate: LensEstimate | None) -> dict[str, Any] | None:
    """
    Return a lens for JSON, or None where it is unknown.

    Deviation, agreeing arcs and their share are null for a lens that was not estimated.
    """
    if model is None:
        return None
    known = {'lambda': model.lam, 'centre': model.origin.tolist()}
    if estimate is None:
        return known | {'deviation': None, 'agreeing': None, 'share': None}
    return known | {'deviation': estimate.std, 'agreeing': estimate.agreeing,
                    'share': estimate.share}


def attitude(found: Attitude | None, reason: str) -> dict[str, Any]:
    """Return an attitude for JSON, with null for all that the image does not show, and why."""
    up = None if found is None else found.up
    roll, pitch = (None, None) if up is None else roll_and_pitch(up)
    std = None if found is None or found.up_std is None else math.degrees(found.up_std)
    return {
        'up': None if up is None else up.tolist(),
        'roll': roll,
        'pitch': pitch,
        'up_deviation': std,
        'focal_length': None if found is None else found.focal,
        'focal_length_deviation': None if found is None else found.focal_std,
        'directions': [] if found is None else found.directions.tolist(),
        'reasons': [reason] if found is None else list(found.reasons),
    }
