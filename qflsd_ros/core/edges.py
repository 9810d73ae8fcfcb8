"""
Step 1a: gradients, Canny's edge map, and where between the pixels an edge lies.

The gradients are Sobel's: a step of h grey levels gives 4 h, in int16.
References: J. Canny, A computational approach to edge detection, PAMI 1986; F. Devernay, A
non-maxima suppression method for edge detection with sub-pixel accuracy, INRIA RR-2724, 1995.
"""
from __future__ import annotations

import math

import cv2
import numpy as np

from qflsd_ros.core.circle import compiled

SOBEL_GAIN = 4.0        # Sobel's response to a step of one grey level


def gradients(gray: np.ndarray, blur_sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the Sobel gradients (dx, dy), (H, W) int16 each, of a blurred (H, W) uint8 image."""
    if blur_sigma > 0:
        reach = max(1, math.ceil(2 * blur_sigma))
        size = (2 * reach + 1, 2 * reach + 1)
        gray = cv2.GaussianBlur(gray, size, blur_sigma, borderType=cv2.BORDER_REPLICATE)
    return cv2.spatialGradient(gray, ksize=3, borderType=cv2.BORDER_REPLICATE)


def edge_map(dx: np.ndarray, dy: np.ndarray, low: float, high: float, out: np.ndarray) -> None:
    """
    Write Canny's edge map, (H, W) uint8, to ``out``; its outermost rows and columns are zero.

    ``low`` and ``high`` are steps across an edge in grey levels.
    """
    cv2.Canny(dx, dy, SOBEL_GAIN * low, SOBEL_GAIN * high, out, L2gradient=True)
    out[0], out[-1] = 0, 0
    out[:, 0], out[:, -1] = 0, 0


@compiled
def locate(dx: np.ndarray, dy: np.ndarray, width: int, xs: np.ndarray, ys: np.ndarray, n: int,
           px: np.ndarray, py: np.ndarray) -> None:
    """
    Find the subpixel positions of edge pixels, after Devernay.

    The gradient's magnitude at the pixel and at its two neighbours along x or y, whichever is
    closer to the gradient, is taken for a parabola; its maximum lies on the edge.

    Parameters
    ----------
    dx, dy
        (H W,) int16, the gradients, row by row.
    width
        Pixels in a row.
    xs, ys
        (E,) int32, of which the first n are the pixels; none lies on the image's border.
    px, py
        (E,) float32, takes the positions, px.

    """
    for i in range(n):
        at = ys[i] * width + xs[i]
        across_x = abs(dx[at]) >= abs(dy[at])
        step = 1 if across_x else width
        before, here, after = at - step, at, at + step
        a = math.sqrt(np.float32(dx[before]) ** 2 + np.float32(dy[before]) ** 2)
        b = math.sqrt(np.float32(dx[here]) ** 2 + np.float32(dy[here]) ** 2)
        c = math.sqrt(np.float32(dx[after]) ** 2 + np.float32(dy[after]) ** 2)
        bend = a - 2 * b + c
        offset = np.float32(0)
        if bend < 0:
            offset = min(max(np.float32(0.5) * (a - c) / bend, np.float32(-0.5)), np.float32(0.5))
        px[i] = xs[i] + (offset if across_x else np.float32(0))
        py[i] = ys[i] + (np.float32(0) if across_x else offset)
