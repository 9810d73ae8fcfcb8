"""The results of one picture as files: overlay (PNG), table (CSV), everything (JSON)."""
from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from qflsd_ros import overlay
from qflsd_ros.cli.inputs import Picture
from qflsd_ros.cli.settings import Settings
from qflsd_ros.cli.writing import write_whole
from qflsd_ros.core import Arcs, DivisionModel, LensEstimate

SUFFIXES = ('.png', '.csv', '.json')


def write(folder: Path, room: Path, picture: Picture, pixels: np.ndarray, arcs: Arcs,
          lens: dict[str, Any] | None, settings: Settings) -> None:
    """
    Write overlay, CSV and JSON of a picture into a folder; each file is whole or not there.

    Raises
    ------
    OSError
        A file cannot be written.

    """
    drawn = overlay.draw(pixels, arcs, settings.node.line_width)
    contents = (cv2.imencode('.png', drawn)[1].tobytes(), table(arcs).encode(),
                description(picture, pixels.shape[:2], arcs, lens, settings).encode())
    for suffix, content in zip(SUFFIXES, contents):
        write_whole(folder, picture.name + suffix, content, room)


def table(arcs: Arcs) -> str:
    """Return the arcs as CSV: a header, then a row an arc; start becomes start_x, start_y."""
    columns = {name: column.tolist() for name, column in arcs.columns().items()}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(columns)
    writer.writerows(zip(*columns.values()))
    return text.getvalue()


def description(picture: Picture, shape: tuple[int, int], arcs: Arcs,
                lens: dict[str, Any] | None, settings: Settings) -> str:
    """Return a picture of a shape (height, width), its lens, parameters and arcs as JSON."""
    names = arcs.table.dtype.names
    # What is not known is nan in a table, null in JSON.
    columns = [np.where(np.isnan(arcs.table[name]), None, arcs.table[name]).tolist()
               for name in names]
    polylines = arcs.polylines(settings.node.polyline_tolerance)
    return json.dumps({
        'image': str(picture.path),
        'frame': picture.frame,
        'width': shape[1],
        'height': shape[0],
        'parameters': settings.values(),
        'lens': lens,
        'arcs': [dict(zip(names, row)) | {'points': points.tolist()}
                 for *row, points in zip(*columns, polylines)],
    })


def lens(model: DivisionModel | None, estimate: LensEstimate | None) -> dict[str, Any] | None:
    """Return a lens for JSON, null for what only an estimate has; None where none is known."""
    if model is None:
        return None
    known = {'lambda': model.lam, 'centre': model.origin.tolist()}
    if estimate is None:
        return known | {'deviation': None, 'agreeing': None, 'share': None}
    return known | {'deviation': estimate.std, 'agreeing': estimate.agreeing,
                    'share': estimate.share}
