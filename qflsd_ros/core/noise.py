"""
How noisy an image is, estimated from the image itself.

The difference of two Laplacians is 0 on everything that varies linearly along x or along y, edges
along the axes among it; what it leaves is noise, and texture.  It is looked at in blocks all over
the image, of which those with the least are flat enough to show the noise alone.

Reference: J. Immerkaer, Fast noise variance estimation, CVIU 64(2), 1996.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined

HEIGHT, WIDTH = 2, 32   # px, of a block: few rows, which lie far apart in memory
ROWS, COLUMNS = 12, 16  # of blocks
FLATTEST = 0.1          # share of the blocks that are believed to show noise alone
BLUR = 0.08             # px for each grey level of noise
MOST_BLUR = 2.0         # px; more noise than that blur is for is texture all over the image
BREAKING = 3.0          # grey levels of noise from which on it breaks edges up
FEWEST = 5              # edge points of the shortest piece to look for, however much there is
SOBEL_BLUR = 0.42       # px^2, variance of the Gaussian whose derivative is about Sobel's
GAIN = math.sqrt(math.pi / 2) / 6       # standard deviation of white noise over mean response


@inlined
def _response(gray: np.ndarray, top: int, left: int) -> float:
    """Return the mean absolute response in a block, or -1 where a pixel is saturated."""
    total, darkest, brightest = np.int32(0), np.int32(255), np.int32(0)
    for y in range(top, top + HEIGHT):
        above, here, below = gray[y - 1], gray[y], gray[y + 1]
        for x in range(left, left + WIDTH):
            a = np.int32(above[x - 1]) - 2 * np.int32(above[x]) + np.int32(above[x + 1])
            b = np.int32(here[x - 1]) - 2 * np.int32(here[x]) + np.int32(here[x + 1])
            c = np.int32(below[x - 1]) - 2 * np.int32(below[x]) + np.int32(below[x + 1])
            total += abs(a - 2 * b + c)
            darkest = min(darkest, np.int32(here[x]))
            brightest = max(brightest, np.int32(here[x]))
    return total / (HEIGHT * WIDTH) if darkest > 0 and brightest < 255 else -1.0


@compiled
def _responses(gray: np.ndarray, responses: np.ndarray) -> int:
    """
    Write the mean absolute response of blocks without a saturated pixel; return their number.

    ``gray`` is (H, W) uint8, larger by 2 px than a block, ``responses`` (ROWS COLUMNS,).
    """
    height, width = gray.shape
    count = 0
    for row in range(ROWS):
        top = 1 + row * (height - 2 - HEIGHT) // (ROWS - 1)
        for column in range(COLUMNS):
            left = 1 + column * (width - 2 - WIDTH) // (COLUMNS - 1)
            responses[count] = _response(gray, top, left)
            count += responses[count] >= 0
    return count


def blur(least: float, noise: float) -> float:
    """Return the standard deviation in px of the blur that an image with such noise needs."""
    return math.hypot(least, min(BLUR * noise, MOST_BLUR))


def shortest(usual: int, noise: float) -> int:
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


def estimate(gray: np.ndarray) -> float:
    """
    Return the standard deviation of the noise of an image in grey levels.

    ``gray`` is a (H, W) uint8 array.  Where there is no block to look at, since the image is too
    small or saturated everywhere, it is 0.
    """
    if gray.shape[0] < HEIGHT + 2 or gray.shape[1] < WIDTH + 2:
        return 0.0
    responses = np.empty(ROWS * COLUMNS)
    count = _responses(gray, responses)
    if count == 0:
        return 0.0
    place = int(FLATTEST * count)
    responses[:count].partition(place)
    return GAIN * float(responses[place])
