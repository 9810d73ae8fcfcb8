"""Drawing of arcs on their image."""
from __future__ import annotations

import cv2
import numpy as np

from qflsd_ros.core.arcs import Arcs

TOLERANCE = 0.25  # px between an arc and its drawn polyline: invisible with anti-aliasing
# Fractional bits of cv2's fixed-point coordinates; (0, 0) is the centre of a pixel there too.
SUBPIXEL_BITS = 4
# Multiples of the golden section modulo 1 stay far from each other (Knuth, The Art of Computer
# Programming, 6.4), and so do hues.
GOLDEN_SECTION = 0.6180339887498949


def colours(count: int) -> np.ndarray:
    """
    Return ``count`` well-separated bright colours: (count, 3) uint8, B, G, R.

    Colour i does not depend on ``count``.
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
    Draw the arcs on a copy of their image, anti-aliased, each in its own colour.

    Parameters
    ----------
    image
        (H, W) uint8 grey or (H, W, 3) uint8 B, G, R.
    arcs
        Arcs of that image; coordinates in px, (0, 0) is the centre of the top-left pixel.
    line_width
        Width of a drawn arc in px, at least 1.

    Returns
    -------
    overlay
        (H, W, 3) uint8 B, G, R, contiguous; ``image`` is not changed.

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
