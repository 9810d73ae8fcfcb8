"""
Step 1a: gradients, Canny's edge map, and where between the pixels an edge lies.

Gradients are in grey levels: a step of h grey levels across an edge gives the magnitude h.
References: J. Canny, A computational approach to edge detection, PAMI 1986; F. Devernay, A
non-maxima suppression method for edge detection with sub-pixel accuracy, INRIA RR-2724, 1995.
"""
from __future__ import annotations

import math

import cv2
import numpy as np

from qflsd_ros.core.compilation import compiled

SOBEL_GAIN = 4.0                # Sobel's response to a step of one grey level
WEAK, STRONG = 1, 2             # what an edge pixel is in the edge map
MASKED = -32768                 # what dx becomes where no arc may pass; Sobel never gives it
MASK_MARGIN = 2                 # px around what is masked in which there are no edges either
TAN_22 = math.sqrt(2) - 1       # tangent of 22.5 degrees


def gradients(gray: np.ndarray, blur_sigma: float, blurred: np.ndarray,
              dx: np.ndarray, dy: np.ndarray) -> None:
    """Write the Sobel gradients of a blurred (H, W) uint8 image to (H, W) int16 dx and dy."""
    if blur_sigma > 0:
        side = 2 * max(1, math.ceil(2 * blur_sigma)) + 1
        gray = cv2.GaussianBlur(gray, (side, side), blur_sigma, blurred,
                                borderType=cv2.BORDER_REPLICATE)
    cv2.spatialGradient(gray, dx, dy, ksize=3, borderType=cv2.BORDER_REPLICATE)


@compiled
def magnitudes(dx: np.ndarray, dy: np.ndarray, magnitude: np.ndarray) -> None:
    """Write the gradient's magnitude in grey levels; all (H W,), dx, dy int16, else float32."""
    scale = np.float32(1 / SOBEL_GAIN)
    for i in range(len(dx)):
        x, y = np.float32(dx[i]), np.float32(dy[i])
        magnitude[i] = scale * np.float32(math.sqrt(x * x + y * y))


@compiled
def thin(dx: np.ndarray, dy: np.ndarray, magnitude: np.ndarray, low: float, high: float,
         edges: np.ndarray) -> int:
    """
    Find the pixels at which the magnitude is largest across the edge (Canny).

    The loop has no branches, so that the compiler can do several pixels at once.

    Parameters
    ----------
    dx, dy, magnitude
        (H, W), int16 and float32, as :func:`gradients` and :func:`magnitudes` leave them.
    low, high
        Magnitudes in grey levels from which on a pixel is weak or strong.
    edges
        (H, W) uint8, takes WEAK or STRONG at edge pixels, 0 elsewhere and in the outermost rows
        and columns.

    Returns
    -------
    Number of edge pixels.

    """
    height, width = magnitude.shape
    tangent, low, high = np.float32(TAN_22), np.float32(low), np.float32(high)
    edges[0], edges[height - 1], edges[:, 0], edges[:, width - 1] = 0, 0, 0, 0
    count = 0
    for row in range(1, height - 1):
        gx, gy, out = dx[row, 1:-1], dy[row, 1:-1], edges[row, 1:-1]
        up, here, down = magnitude[row - 1], magnitude[row], magnitude[row + 1]
        up_left, up_mid, up_right = up[:-2], up[1:-1], up[2:]
        left, mid, right = here[:-2], here[1:-1], here[2:]
        down_left, down_mid, down_right = down[:-2], down[1:-1], down[2:]
        found = np.int32(0)
        for i in range(width - 2):
            x, y = np.float32(gx[i]), np.float32(gy[i])
            ul, um, ur, ll, m, rr = up_left[i], up_mid[i], up_right[i], left[i], mid[i], right[i]
            dl, dm, dr = down_left[i], down_mid[i], down_right[i]
            falling = x * y > 0
            before = ul if falling else ur
            after = dr if falling else dl
            before = um if abs(x) < tangent * abs(y) else before
            after = dm if abs(x) < tangent * abs(y) else after
            before = ll if abs(y) < tangent * abs(x) else before
            after = rr if abs(y) < tangent * abs(x) else after
            edge = (m > before) & (m >= after) & (m >= low)
            out[i] = np.uint8(edge) + np.uint8(edge & (m >= high))
            found += np.int32(edge)
        count += found
    return count


def blocked(mask: np.ndarray) -> np.ndarray:
    """Return where edges may not be, (H, W) bool: where a mask is zero, and close to it."""
    side = 2 * MASK_MARGIN + 1
    return cv2.erode((mask != 0).astype(np.uint8), np.ones((side, side), np.uint8)) == 0


def remove(dx: np.ndarray, edges: np.ndarray, where: np.ndarray) -> None:
    """Take out the edges in a region, (H, W) bool, and mark it in dx for what comes after."""
    np.copyto(edges, 0, where=where)
    np.copyto(dx, MASKED, where=where)


@compiled
def locate(dx: np.ndarray, dy: np.ndarray, magnitude: np.ndarray, width: int,
           xs: np.ndarray, ys: np.ndarray, n: int, points: np.ndarray) -> None:
    """
    Find the subpixel positions of edge pixels, after Devernay, and the gradients there.

    The gradient's magnitude at the pixel and at its two neighbours along x or y, whichever is
    closer to the gradient, is taken for a parabola; its maximum lies on the edge.  Where the
    gradient is oblique, the pixel that is largest across the edge may have a larger neighbour in
    that direction; the parabola is then taken around that one, up to a pixel away.

    Parameters
    ----------
    dx, dy, magnitude
        (H W,) as :func:`magnitudes` leaves them.
    width
        Pixels in a row.
    xs, ys, n
        (E,) int32, of which the first n are the pixels; none lies on the image's border.
    points
        (4, E) float32, takes the positions x and y, px, and the gradient in grey levels.

    """
    half, one, scale = np.float32(0.5), np.float32(1), np.float32(1 / SOBEL_GAIN)
    for i in range(n):
        at = ys[i] * width + xs[i]
        gx, gy = np.float32(dx[at]), np.float32(dy[at])
        across_x = abs(gx) >= abs(gy)
        step = 1 if across_x else width
        a, b, c = magnitude[at - step], magnitude[at], magnitude[at + step]
        shift = 0
        if a > b and at >= 2 * step:
            shift, a, b, c = -1, magnitude[at - 2 * step], a, b
        elif c > b and at + 2 * step < len(magnitude):
            shift, a, b, c = 1, b, c, magnitude[at + 2 * step]
        bend = a - 2 * b + c
        offset = np.float32(0)
        if bend < 0:
            offset = min(max(half * (a - c) / bend + shift, -one), one)
        points[0, i] = xs[i] + (offset if across_x else np.float32(0))
        points[1, i] = ys[i] + (np.float32(0) if across_x else offset)
        points[2, i], points[3, i] = scale * gx, scale * gy
