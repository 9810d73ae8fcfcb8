"""A folder of images with their stamps and poses and the calibration of the camera."""
from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.sources.files import encoding, read_file, read_image
from qflsd_ros.sources.frames import Frame, Report, Source, SourceError

DESCRIPTION = 'sequence.json'
LATEST = 2**31 - 1      # s, limit of builtin_interfaces/Time
# Largest deviation of a rotation from an orthogonal matrix, the rounding of poses that are written
# with four digits.
ORTHOGONAL = 1e-3


class Entry(NamedTuple):
    """A frame of a sequence: its image file, its stamp in ns, and its pose, (4, 4) float64."""

    image: str
    stamp: int
    pose: np.ndarray


class Sequence(Source):
    """
    The frames that a ``sequence.json`` lists, in its order, as mono8 or bgr8.

    The file is an object of JSON (doc/camera.md): ``K``, the camera matrix in px; ``distortion``,
    the coefficients of ``distortion_model``; and ``frames``, a list of objects with ``image``,
    ``stamp`` (s) and ``pose`` (4 x 4, from the optical frame to the map, m).  Other members are
    ignored.

    Raises
    ------
    SourceError
        The file cannot be read, or a member is missing or has no usable value.

    """

    posed = True

    def __init__(self, folder: Path, colour: bool, report: Report) -> None:
        super().__init__(repr(str(folder)), report)
        self._folder, self._colour = folder, colour
        try:
            content = json.loads(read_file(folder / DESCRIPTION))
            self.camera = _camera(content)
            self._entries = _entries(content)
        except (ValueError, RecursionError) as error:
            raise SourceError(f'{str(folder / DESCRIPTION)!r}: {error}') from error

    def _frames(self) -> Iterator[Frame]:
        for entry in self._entries:
            try:
                image = read_image(self._folder / entry.image, self._colour)
            except SourceError as error:
                self._skip(str(error))
                continue
            yield Frame.of(image, encoding(self._colour), entry.image, stamp=entry.stamp,
                           recorded=entry.stamp, pose=entry.pose)


def _camera(content: Any) -> CameraModel:
    """Return the calibrated camera; ValueError if it is none."""
    model = _member(content, 'distortion_model', 'plumb_bob')
    coefficients = _numbers(_member(content, 'distortion', []), (-1,), 'distortion')
    return CameraModel(str(model), _numbers(_member(content, 'K'), (3, 3), 'K'), coefficients)


def _entries(content: Any) -> list[Entry]:
    """Return the list of frames; ValueError, which names the frame, if one is none."""
    frames = _member(content, 'frames')
    if not isinstance(frames, list) or not frames:
        raise ValueError('frames must be a list of at least one frame')
    return [_entry(frame, number) for number, frame in enumerate(frames)]


def _entry(frame: Any, number: int) -> Entry:
    try:
        image = _member(frame, 'image')
        if not isinstance(image, str) or '\0' in image:
            raise ValueError('image must be the name of a file')
        stamp = float(_numbers(_member(frame, 'stamp'), (), 'stamp'))
        if not 0 <= stamp < LATEST:
            raise ValueError(f'stamp is {stamp:g}: must lie in 0 to {LATEST} s')
        pose = _numbers(_member(frame, 'pose'), (4, 4), 'pose')
        turn = pose[:3, :3]
        if (np.abs(turn @ turn.T - np.eye(3)).max() > ORTHOGONAL or np.linalg.det(turn) < 0
                or pose[3].tolist() != [0, 0, 0, 1]):
            raise ValueError('pose must be a rotation and a translation above the row 0 0 0 1')
    except ValueError as error:
        raise ValueError(f'frame {number}: {error}') from error
    # In two parts: float64 has no ns of a date.
    return Entry(image, int(stamp) * 10**9 + round(stamp % 1 * 1e9), pose)


def _member(content: Any, name: str, default: Any = None) -> Any:
    """Return a member of an object; ValueError without it, unless there is a default."""
    if not isinstance(content, dict):
        raise ValueError(f'must be an object with {name}')
    if name not in content and default is None:
        raise ValueError(f'{name} is missing')
    return content.get(name, default)


def _numbers(value: Any, shape: tuple[int, ...], name: str) -> np.ndarray:
    """Return finite numbers of a shape, -1 for any length; ValueError for anything else."""
    try:
        found = np.array(value, float)
    except (TypeError, ValueError, OverflowError):
        found = np.full(1, np.nan)
    if (found.ndim != len(shape) or not np.isfinite(found).all()
            or any(wanted not in (-1, got) for wanted, got in zip(shape, found.shape))):
        size = ' x '.join('N' if wanted < 0 else str(wanted) for wanted in shape)
        raise ValueError(f'{name} must be {size + " numbers" if size else "a number"}')
    return found
