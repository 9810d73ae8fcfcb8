"""The results of one picture as files: overlay (PNG), table (CSV), everything (JSON)."""
from __future__ import annotations

import csv
import dataclasses
import io
import json
from pathlib import Path

import cv2
import numpy as np

from qflsd_ros import overlay
from qflsd_ros.cli.inputs import Picture
from qflsd_ros.cli.writing import write_whole
from qflsd_ros.core import Arcs, LensEstimate, Parameters

SUFFIXES = ('.png', '.csv', '.json')


def write(folder: Path, picture: Picture, pixels: np.ndarray, arcs: Arcs,
          lens: LensEstimate | None, parameters: Parameters) -> None:
    """
    Write overlay, CSV and JSON of a picture into a folder; each file is whole or not there.

    Raises
    ------
    OSError
        A file cannot be written.

    """
    base = folder / picture.name
    base.parent.mkdir(parents=True, exist_ok=True)
    contents = (cv2.imencode('.png', overlay.draw(pixels, arcs))[1].tobytes(),
                table(arcs).encode(),
                description(picture, pixels.shape[:2], arcs, lens, parameters).encode())
    for suffix, content in zip(SUFFIXES, contents):
        write_whole(base.with_name(base.name + suffix), content)


def table(arcs: Arcs) -> str:
    """Return the arcs as CSV: a header, then a row an arc; start becomes start_x, start_y."""
    columns = {name: column.tolist() for name, column in arcs.columns().items()}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(columns)
    writer.writerows(zip(*columns.values()))
    return text.getvalue()


def description(picture: Picture, shape: tuple[int, int], arcs: Arcs,
                lens: LensEstimate | None, parameters: Parameters) -> str:
    """Return a picture of a shape (height, width), its lens, parameters and arcs as JSON."""
    names = arcs.table.dtype.names
    # What is not known is nan in a table, null in JSON.
    columns = [np.where(np.isnan(arcs.table[name]), None, arcs.table[name]).tolist()
               for name in names]
    return json.dumps({
        'image': str(picture.path),
        'frame': picture.frame,
        'width': shape[1],
        'height': shape[0],
        'parameters': dataclasses.asdict(parameters),
        'lens': lens and {'lambda': lens.lam, 'deviation': lens.std, 'agreeing': lens.agreeing,
                          'share': lens.share},
        'arcs': [dict(zip(names, row)) | {'points': points.tolist()}
                 for *row, points in zip(*columns, arcs.polylines())],
    })
