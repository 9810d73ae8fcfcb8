"""A frame with its arcs drawn on it."""
from __future__ import annotations

import cv2
import numpy as np

from qflsd_ros.core.arcs import Arcs

TOLERANCE = 0.25  # px between an arc and what is drawn of it
SUBPIXEL_BITS = 4  # cv2 takes fixed-point coordinates; (0, 0) is the centre of a pixel there too
# Multiples of the golden section never come close to each other, modulo 1.
GOLDEN_SECTION = 0.6180339887498949


def colours(count: int) -> np.ndarray:
    """
    Return ``count`` well-separated bright colours: (count, 3) uint8, B, G, R.

    Colour i is the same for every count.
    """
    index = np.arange(count)
    hsv = np.empty((count, 1, 3), np.float32)
    hsv[:, 0, 0] = index * GOLDEN_SECTION % 1 * 360
    hsv[:, 0, 1] = np.where(index % 2, 0.65, 1)
    hsv[:, 0, 2] = 1
    if not count:
        return np.empty((0, 3), np.uint8)
    return np.rint(cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR)[:, 0] * 255).astype(np.uint8)


def draw(image: np.ndarray, arcs: Arcs, line_width: int = 1) -> np.ndarray:
    """
    Draw every arc on a copy of its image, anti-aliased and in a colour of its own.

    Parameters
    ----------
    image
        (H, W) uint8 grey or (H, W, 3) uint8 B, G, R.
    arcs
        What was found in it; coordinates in px, (0, 0) is the centre of the top-left pixel.
    line_width
        Width of a drawn arc in px, at least 1.

    Returns
    -------
    overlay
        (H, W, 3) uint8 B, G, R, contiguous; ``image`` itself stays as it is.

    """
    overlay = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy('C')
    points, counts = arcs.vertices(TOLERANCE)
    fixed = np.rint(points * (1 << SUBPIXEL_BITS)).astype(np.int32)
    last = np.cumsum(counts)
    for begin, end, colour in zip((last - counts).tolist(), last.tolist(),
                                  colours(len(arcs)).tolist()):
        cv2.polylines(overlay, [fixed[begin:end]], False, colour, line_width,
                      cv2.LINE_AA, SUBPIXEL_BITS)
    return overlay
