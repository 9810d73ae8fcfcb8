"""Drawing of arcs, and of the last positions of their tracks, on their image."""
from __future__ import annotations

from collections import deque
from typing import NamedTuple

import cv2
import numpy as np

from qflsd_ros.core.arcs import Arcs

TOLERANCE = 0.25  # px between an arc and its drawn polyline: invisible with anti-aliasing
# Fractional bits of cv2's fixed-point coordinates; (0, 0) is the centre of a pixel there too.
SUBPIXEL_BITS = 4
# Multiples of the golden section modulo 1 stay far from each other (Knuth, The Art of Computer
# Programming, 6.4), and so do hues.
GOLDEN_SECTION = 0.6180339887498949


class Tails(NamedTuple):
    """
    The ways of tracks through the frames before: steps from one frame to the next.

    Attributes
    ----------
    tracks
        (K,) uint32, the identity to which each step belongs.
    steps
        (K, 2, 2) float64 px, the middle of its arc in one frame and in the next.

    """

    tracks: np.ndarray
    steps: np.ndarray


NO_TAILS = Tails(np.zeros(0, np.uint32), np.zeros((0, 2, 2)))


class Trails:
    """The steps of all tracks in the last frames."""

    def __init__(self) -> None:
        """Begin without a frame."""
        self._last = Arcs.empty()
        self._steps: deque[Tails] = deque()

    def follow(self, arcs: Arcs, count: int) -> Tails:
        """Add the next frame; return the steps of its tracks through ``count`` frames before."""
        before, self._last = self._last, arcs
        if not (count and before.is_tracked and arcs.is_tracked):
            self._steps.clear()
            return NO_TAILS
        self._steps.append(_steps(before.table, arcs.table))
        while len(self._steps) > count:
            self._steps.popleft()
        tracks, steps = map(np.concatenate, zip(*self._steps))
        alive = np.isin(tracks, arcs.table['track'])
        return Tails(tracks[alive], steps[alive])


def _steps(before: np.ndarray, now: np.ndarray) -> Tails:
    """Return the steps of the tracks that two tables of successive frames have in common."""
    common, old, new = np.intersect1d(before['track'], now['track'], return_indices=True)
    return Tails(common, np.stack([before['middle'][old], now['middle'][new]], axis=1))


def numbers(arcs: Arcs) -> np.ndarray:
    """Return the number of the colour of each arc, (M,): of its track, or else its own."""
    return arcs.table['track'] if arcs.is_tracked else np.arange(len(arcs))


def colours(numbers: np.ndarray) -> np.ndarray:
    """
    Return the colours of numbers >= 0, (M,): (M, 3) uint8, B, G, R.

    Each is bright, and far from those of the next numbers.
    """
    if not len(numbers):
        return np.empty((0, 3), np.uint8)
    hsv = np.empty((len(numbers), 1, 3), np.float32)
    hsv[:, 0, 0] = numbers * GOLDEN_SECTION % 1 * 360
    hsv[:, 0, 1] = np.where(numbers % 2, 0.65, 1)
    hsv[:, 0, 2] = 1
    return np.rint(cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR)[:, 0] * 255).astype(np.uint8)


# Colours of directions, B, G, R: up, two horizontal axes, further horizontal ones; and of none.
DIRECTIONS = np.array([(255, 96, 32), (48, 48, 255), (48, 208, 48), (0, 208, 255),
                       (255, 64, 224), (224, 224, 0), (144, 144, 144)], np.uint8)


def direction_colours(arcs: Arcs) -> np.ndarray:
    """
    Return the colour of the direction of each arc: (M, 3) uint8, B, G, R.

    It is blue for vertical ones, red and green for the horizontal axes, grey for none.
    """
    names = arcs.table.dtype.names or ()
    labels = arcs.table['direction'] if 'direction' in names else np.full(len(arcs), -1)
    return DIRECTIONS[labels]


def draw(image: np.ndarray, arcs: Arcs, line_width: int = 1,
         tails: Tails = NO_TAILS) -> np.ndarray:
    """
    Draw the arcs on a copy of their image, anti-aliased, each in the colour of its track.

    Arcs without tracks have a colour each, by their number in the image.

    Parameters
    ----------
    image
        (H, W) uint8 grey or (H, W, 3) uint8 B, G, R.
    arcs
        Arcs of that image; coordinates in px, (0, 0) is the centre of the top-left pixel.
    line_width
        Width of a drawn arc in px, at least 1.
    tails
        Last positions of the tracks, drawn below the arcs and 1 px wide.

    Returns
    -------
    overlay
        (H, W, 3) uint8 B, G, R, contiguous; ``image`` is not changed.

    """
    overlay = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy('C')
    tracks, owner = np.unique(tails.tracks, return_inverse=True)
    steps = _fixed(tails.steps)
    for number, colour in enumerate(colours(tracks).tolist()):
        cv2.polylines(overlay, steps[owner == number], False, colour, 1, cv2.LINE_AA,
                      SUBPIXEL_BITS)
    points, counts = arcs.vertices(TOLERANCE)
    fixed = _fixed(points)
    last = np.cumsum(counts)
    for begin, end, colour in zip((last - counts).tolist(), last.tolist(),
                                  colours(numbers(arcs)).tolist()):
        cv2.polylines(overlay, [fixed[begin:end]], False, colour, line_width,
                      cv2.LINE_AA, SUBPIXEL_BITS)
    return overlay


def _fixed(points: np.ndarray) -> np.ndarray:
    """Return px as fixed-point coordinates of cv2."""
    return np.rint(points * (1 << SUBPIXEL_BITS)).astype(np.int32)
