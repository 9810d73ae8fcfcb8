"""
The noise of an image, estimated from the image itself.

The difference of two Laplacians responds to noise and texture.  It is 0 on any signal that is
linear along x or along y, edges along the axes included.  Its mean absolute value is taken in
blocks all over the image; the blocks with the lowest responses are flat and show noise alone.

A block without any response has no noise: the whole image has none, or the block lies in a bar,
patch or caption that was drawn later.  Such blocks do not count in an image that has noise.

Reference: J. Immerkaer, Fast noise variance estimation, CVIU 64(2), 1996.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.region import Region, region
from qflsd_ros.core.detection.spacing import place

# All of these are chosen, not tuned, unless stated otherwise.
HEIGHT, WIDTH = 8, 8    # px, of a block
ROWS, COLUMNS = 14, 14  # of blocks
FLATTEST = 0.1          # share of the blocks that show noise alone, without texture
# Least share of blocks in which most pixels respond, in an image with noise: an upright film
# between bars fills a quarter of a wide screen, and clean edges alone pass fewer blocks.
NOISY = 0.25
# Mean response from which on pixels without response belong to a bar or patch that covers part of
# the block: noise this strong (1.7 grey levels) leaves only 4 % of the pixels at 0 by chance.
CUT = 8.0
BLUR = 0.08             # px for each grey level of noise
MOST_BLUR = 2.0         # px; an estimate of more noise comes from texture all over the image
BREAKING = 3.0          # grey levels of noise from which on it interrupts edges
FEWEST = 5              # edge points of the shortest piece, however strong the noise
GAIN = math.sqrt(math.pi / 2) / 6       # standard deviation of white noise over mean response
SOBEL_BLUR = 0.42       # px^2, variance of the Gaussian whose derivative is about Sobel's


@inlined
def _response(gray: np.ndarray, top: int, left: int) -> tuple[np.int32, np.int32, bool]:
    """Return a block's sum of absolute responses, its number of 0s, and if it is saturated."""
    total, still, darkest, brightest = np.int32(0), np.int32(0), np.int32(255), np.int32(0)
    for y in range(top, top + HEIGHT):
        above, here, below = gray[y - 1], gray[y], gray[y + 1]
        for x in range(left, left + WIDTH):
            a = np.int32(above[x - 1]) - 2 * np.int32(above[x]) + np.int32(above[x + 1])
            b = np.int32(here[x - 1]) - 2 * np.int32(here[x]) + np.int32(here[x + 1])
            c = np.int32(below[x - 1]) - 2 * np.int32(below[x]) + np.int32(below[x + 1])
            response = abs(a - 2 * b + c)
            total += response
            still += np.int32(response == 0)
            darkest = min(darkest, np.int32(here[x]))
            brightest = max(brightest, np.int32(here[x]))
    return total, still, bool(darkest == 0 or brightest == 255)


@inlined
def _is_masked(allowed: np.ndarray, top: int, left: int) -> bool:
    """Return whether a block, or a pixel next to it, is masked: its responses depend on both."""
    for y in range(top - 1, top + HEIGHT + 1):
        for x in range(left - 1, left + WIDTH + 1):
            if not allowed[y, x]:
                return True
    return False


@compiled
def _responses(gray: np.ndarray, where: Region, responses: np.ndarray) -> tuple[int, int, int]:
    """
    Write the mean absolute response of the blocks of a region that respond and are not saturated.

    ``gray`` is (H, W) uint8, ``responses`` (ROWS COLUMNS,) float64; the region is at least 2 px
    larger than a block.  Returns the number of responses written, the number of these blocks in
    which most pixels respond, and the number of blocks without any response.
    """
    height, width = where.bottom - where.top, where.right - where.left
    count = busy = silent = 0
    for row in range(ROWS):
        top = where.top + 1 + place(row, height - 2 - HEIGHT, ROWS - 1)
        for column in range(COLUMNS):
            left = where.left + 1 + place(column, width - 2 - WIDTH, COLUMNS - 1)
            if where.masked and _is_masked(where.allowed, top, left):
                continue
            total, still, saturated = _response(gray, top, left)
            if saturated:
                continue
            if total == 0:
                silent += 1
                continue
            whole, loud = total / (HEIGHT * WIDTH), total / (HEIGHT * WIDTH - still)
            responses[count] = whole if loud < CUT else loud
            count += 1
            busy += int(2 * still < HEIGHT * WIDTH)
    return count, busy, silent


def blur(least: float, noise: float) -> float:
    """Return the standard deviation, px, of the blur: ``least``, and more against noise."""
    return math.hypot(least, min(BLUR * noise, MOST_BLUR))


def min_points(usual: int, noise: float) -> int:
    """
    Return the number of edge points of the shortest piece.

    Noise interrupts edges: each grey level above BREAKING shortens the ``usual`` piece by a point.
    """
    return max(FEWEST, usual - max(0, int(noise - BREAKING)))


def of_gradient(noise: float, blur_sigma: float) -> float:
    """
    Return the noise of dx and dy in grey levels after a Gaussian blur.

    The derivative of a Gaussian of variance v gives white noise of variance 1 the variance
    1 / (8 pi v^2).  A gradient here is about twice that derivative: the change over 2 px.  Sobel's
    filter adds SOBEL_BLUR to the variance of the blur.
    """
    return 2 * noise / (math.sqrt(8 * math.pi) * (blur_sigma ** 2 + SOBEL_BLUR))


def estimate(gray: np.ndarray, where: Region | None = None) -> float:
    """
    Return the standard deviation of the noise of an image in grey levels.

    ``gray`` is (H, W) uint8; only ``where``, a region of it, is used (None: all of it).  The
    result is 0 if the region is smaller than a block, or if each block is saturated or masked.
    """
    where = region(gray.shape, None) if where is None else where
    if where.bottom - where.top < HEIGHT + 2 or where.right - where.left < WIDTH + 2:
        return 0.0
    responses = np.zeros(ROWS * COLUMNS)
    count, busy, silent = _responses(gray, where, responses)
    if busy < NOISY * (count + silent):
        count += silent     # the zeros behind the others are the responses of these
    if count == 0:
        return 0.0
    place = int(FLATTEST * count)
    responses[:count].partition(place)
    return GAIN * float(responses[place])
