"""
How noisy an image is, estimated from the image itself.

The difference of two Laplacians is 0 on everything that varies linearly along x or along y, edges
along the axes among it; what it leaves is noise, and texture.  It is looked at in blocks all over
the image, of which those with the least are flat enough to show the noise alone.

Where it is exactly 0 in a whole block, there is no noise at all: either in the image, or in bars
beside it, patches and captions that were put into it after it was taken.  These show nothing of
the noise of the rest.

Reference: J. Immerkaer, Fast noise variance estimation, CVIU 64(2), 1996.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.region import Region, region
from qflsd_ros.core.detection.spacing import place

HEIGHT, WIDTH = 8, 8    # px, of a block
ROWS, COLUMNS = 14, 14  # of blocks
FLATTEST = 0.1          # share of the blocks that are believed to show noise alone
# Share of the blocks that must show something all over, or else the image has no noise: a quarter
# of a wide screen is left to an upright film between bars; clean edges alone pass fewer blocks.
NOISY = 0.25
# Mean response from which on hardly a pixel is without one by chance (noise of 1.7 grey levels
# leaves 4 % at 0): those that are, in a block, are then of a bar or patch that cuts it.
CUT = 8.0
BLUR = 0.08             # px for each grey level of noise
MOST_BLUR = 2.0         # px; more noise than that blur is for is texture all over the image
BREAKING = 3.0          # grey levels of noise from which on it breaks edges up
FEWEST = 5              # edge points of the shortest piece to look for, however much there is
GAIN = math.sqrt(math.pi / 2) / 6       # standard deviation of white noise over mean response
SOBEL_BLUR = 0.42       # px^2, variance of the Gaussian whose derivative is about Sobel's


@inlined
def _response(gray: np.ndarray, top: int, left: int) -> tuple[np.int32, np.int32, bool]:
    """Return a block's sum of absolute responses, how many are 0, and if a pixel is saturated."""
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
    """Return whether any pixel is masked that the responses in a block depend on."""
    for y in range(top - 1, top + HEIGHT + 1):
        for x in range(left - 1, left + WIDTH + 1):
            if not allowed[y, x]:
                return True
    return False


@compiled
def _responses(gray: np.ndarray, where: Region, responses: np.ndarray) -> tuple[int, int, int]:
    """
    Write the mean absolute responses, above 0, of blocks in a region, without saturated pixels.

    ``gray`` is (H, W) uint8, ``responses`` (ROWS COLUMNS,) float64; the region is larger by 2 px
    than a block.  Returns how many there are, in how many of them most pixels respond, and the
    number of blocks without any response.
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
    """Return the standard deviation in px of the blur that an image with such noise needs."""
    return math.hypot(least, min(BLUR * noise, MOST_BLUR))


def min_points(usual: int, noise: float) -> int:
    """
    Return the edge points of the shortest piece that is worth looking for.

    Noise breaks edges up: each grey level of it takes a point off the ``usual`` number.
    """
    return max(FEWEST, usual - max(0, int(noise - BREAKING)))


def of_gradient(noise: float, blur_sigma: float) -> float:
    """
    Return the noise of dx and dy in grey levels after a Gaussian blur.

    White noise through the derivative of a Gaussian of variance v has the variance 1 / (8 pi v^2);
    Sobel's is about one of variance SOBEL_BLUR, and twice that of the grey levels for each pixel.
    """
    return 2 * noise / (math.sqrt(8 * math.pi) * (blur_sigma ** 2 + SOBEL_BLUR))


def estimate(gray: np.ndarray, where: Region | None = None) -> float:
    """
    Return the standard deviation of the noise of an image in grey levels.

    ``gray`` is a (H, W) uint8 array, looked at in a region of it (None: all over).  Where there is
    no block to look at, since that is too small, or saturated or masked everywhere, it is 0.
    """
    where = region(gray.shape, None) if where is None else where
    if where.bottom - where.top < HEIGHT + 2 or where.right - where.left < WIDTH + 2:
        return 0.0
    responses = np.zeros(ROWS * COLUMNS)
    count, busy, silent = _responses(gray, where, responses)
    if busy < NOISY * (count + silent):
        count += silent     # whose responses are the zeros behind the others
    if count == 0:
        return 0.0
    place = int(FLATTEST * count)
    responses[:count].partition(place)
    return GAIN * float(responses[place])
