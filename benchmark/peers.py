"""
The detectors by name, each with two functions: detection, and conversion to polylines.

Every detector runs with its own defaults.  ``NAME=MODULE:FUNCTION`` adds another one: a function
that takes a (H, W) uint8 image and returns rows x0 y0 x1 y1, or a list of (K, 2) polylines, in px
with (0, 0) at the centre of the top-left pixel.
"""
from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
import importlib
import importlib.util
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from qflsd_ros.cli import settings
from qflsd_ros.core import Arcs, Detector, Parameters

OURS, PAPER, LSD, EDLINES, FLOOR = 'qflsd', 'paper', 'lsd', 'edlines', 'canny'
PAPER_SETTINGS = Path(__file__).parents[1] / 'config' / 'paper.yaml'
CORNER = 0.5            # px; pytlsd and lsdetect have (0, 0) at the corner of the image
TOLERANCE = 0.1         # px between an arc and its polyline
TITLES = {
    LSD: 'LSD (OpenCV, C++)', 'pytlsd': 'LSD (pytlsd, C++)', 'lsdetect': 'LSD (lsdetect, Rust)',
    'fld': 'FLD (OpenCV, C++)', EDLINES: 'EDLines (OpenCV, C++)',
    PAPER: 'QF-LSD as published (numpy)', OURS: 'qflsd_ros', FLOOR: 'blur and Canny alone'}


@dataclass(frozen=True)
class Peer:
    """A detector; the conversion to polylines is not part of the measured time."""

    name: str
    detect: Callable[[np.ndarray], Any]
    polylines: Callable[[Any], list[np.ndarray]]

    @property
    def title(self) -> str:
        """Name in tables and plots."""
        return TITLES.get(self.name, self.name)

    def __call__(self, gray: np.ndarray) -> list[np.ndarray]:
        """Return the polylines found in a (H, W) uint8 image, (K, 2) px each."""
        return self.polylines(self.detect(gray))


def available() -> tuple[str, ...]:
    """Return the names of the detectors, other than the published method, that are installed."""
    names = [LSD]
    names += [name for name in ('pytlsd', 'lsdetect') if importlib.util.find_spec(name)]
    if hasattr(cv2, 'ximgproc'):
        names += ['fld', EDLINES]
    return (*names, OURS)


@cache
def load(name: str) -> Peer:
    """Return a detector by its name, or by NAME=MODULE:FUNCTION."""
    cv2.setNumThreads(1)
    if name in MAKERS:
        return MAKERS[name]()
    title, _, place = name.partition('=')
    module, _, function = place.partition(':')
    if not (title and module and function):
        raise ValueError(f'{name!r} is not a detector: must be one of {", ".join(MAKERS)} '
                         'or NAME=MODULE:FUNCTION')
    return Peer(title, getattr(importlib.import_module(module), function), list_of_polylines)


def list_of_polylines(result: Any) -> list[np.ndarray]:
    """Return polylines (K, 2) of rows x0 y0 x1 y1 of any shape, a list of polylines, or None."""
    if result is None:
        return []
    if isinstance(result, Sequence):
        return [np.asarray(line, float).reshape(-1, 2) for line in result]
    return list(np.asarray(result, float).reshape(-1, 2, 2))


def published() -> Parameters:
    """Return the parameters of the published method, from config/paper.yaml."""
    arguments = argparse.Namespace(params=PAPER_SETTINGS, node=settings.NODE)
    return settings.read(arguments, print).detector


def _arcs(name: str, parameters: Callable[[], Parameters]) -> Peer:
    detector = Detector(parameters())
    detector.warm_up()
    return Peer(name, detector.detect, _polylines)


def _polylines(arcs: Arcs) -> list[np.ndarray]:
    return arcs.polylines(TOLERANCE)


def _lsd() -> Peer:
    detector = cv2.createLineSegmentDetector()
    return Peer(LSD, lambda gray: detector.detect(gray)[0], list_of_polylines)


def _fld() -> Peer:
    return Peer('fld', cv2.ximgproc.createFastLineDetector().detect, list_of_polylines)


def _edlines() -> Peer:
    # The shortest line depends on the size of the image that an object has seen first.
    objects: dict[tuple[int, ...], Any] = {}

    def detect(gray: np.ndarray) -> Any:
        if gray.shape not in objects:
            objects[gray.shape] = cv2.ximgproc.createEdgeDrawing()
        objects[gray.shape].detectEdges(gray)
        return objects[gray.shape].detectLines()

    return Peer(EDLINES, detect, list_of_polylines)


def _pytlsd() -> Peer:
    from pytlsd import lsd
    return Peer('pytlsd', lsd, lambda rows: list_of_polylines(rows[:, :4] - CORNER))


def _lsdetect() -> Peer:
    from lsdetect import detect
    return Peer('lsdetect', detect, lambda found: list_of_polylines(
        np.array([(s.x1, s.y1, s.x2, s.y2) for s in found]) - CORNER))


def _canny() -> Peer:
    return Peer(FLOOR, lambda gray: cv2.Canny(cv2.GaussianBlur(gray, (5, 5), 0), 50, 150),
                lambda _: [])


MAKERS: dict[str, Callable[[], Peer]] = {
    LSD: _lsd, 'pytlsd': _pytlsd, 'lsdetect': _lsdetect, 'fld': _fld, EDLINES: _edlines,
    FLOOR: _canny, PAPER: partial(_arcs, PAPER, published), OURS: partial(_arcs, OURS, Parameters)}
