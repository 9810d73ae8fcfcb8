"""
How far the constants of the detector may be off: each is varied by 30 %, all others are kept.

A constant is a name in capitals that a module of the detector binds to an expression with one
number, or to a tuple of such expressions: ``A``, ``B`` and the angle of ``C`` in
``A, B, C = 0.25, 0.4, math.sin(math.radians(10.0))``.  It is the number that is varied, so that of
the sine of an angle the angle is.

numba compiles constants into the kernels.  Every variation therefore runs in a process of its own,
which sets the constant before the first frame, and in which all kernels that depend on it, by
themselves or through kernels that they call, are compiled anew and not kept.  The other kernels
come from the cache.
"""
from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
import importlib
import pkgutil
import sys
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

from benchmark.datasets import LENSES, View
from benchmark.experiment import Experiment
from benchmark.metrics import Comparison, Counts, sample, Samples
from benchmark.parallel import each
from benchmark.peers import TOLERANCE
from benchmark.report import number, table
import cv2
import numba
from numba.core.caching import NullCache
from numba.core.dispatcher import Dispatcher
import numpy as np
from qflsd_ros.core import circle, detection, Detector, detector

CORE = 'qflsd_ros.core'
SMALLER, LARGER = 0.7, 1.3
MIN_LENGTH = 20.0           # px, of annotated lines, and of arcs that are to be found again
# The second view of an image.
CORNER = 0.06               # of the sides, by which the corners of the image move at most
GAIN, OFFSET, NOISE = 0.8, 10.0, 3.0        # the last two in grey levels
BORDER = 6.0                # px, from either view's border to what is to be found again
# Constants that are no choice, by the reason.
FIXED = {
    'layout of memory, or a technical limit': (
        'circle.FIT_SIZE', 'detector.MOST_PIXELS', 'detector.SMALLEST_IMAGE', 'edges.WEAK',
        'edges.STRONG', 'extraction.SECTION', 'grid.CELL', 'joining.NODES', 'joining.COUNT',
        'joining.RSS', 'joining.SIZE', 'order.GRAIN', 'suppression.CELL', 'suppression.ENTRIES'),
    'follows from theory': ('chains.TAN_22', 'edges.SOBEL_GAIN', 'joining.ALIGNED')}


class Constant(NamedTuple):
    """
    A number in the source of a module.

    ``name`` is that of the module without the package and of the constant; ``place`` the index of
    the number among those of an assignment to a tuple, None for a constant that is no tuple.
    """
    name: str
    place: int | None
    value: float
