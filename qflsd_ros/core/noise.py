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

from qflsd_ros.core.compilation import compiled

BLOCK = 8               # px, side of a block
ROWS, COLUMNS = 12, 16  # of blocks
FLATTEST = 0.1          # share of the blocks that are believed to show noise alone
BLUR = 0.08             # px for each grey level of noise
MOST_BLUR = 2.0         # px; more noise than that blur is for is texture all over the image
GAIN = math.sqrt(math.pi / 2) / 6       # standard deviation of white noise over mean response


@compiled
def _responses(gray: np.ndarray, responses: np.ndarray) -> int:
    """
    Write the mean absolute response of blocks without a saturated pixel; return their number.

    ``gray`` is (H, W) uint8 with sides of at least BLOCK + 2, ``responses`` (ROWS COLUMNS,).
    """
    height, width = gray.shape
    count = 0
    for row in range(ROWS):
        top = 1 + row * (height - 2 - BLOCK) // (ROWS - 1)
        for column in range(COLUMNS):
            left = 1 + column * (width - 2 - BLOCK) // (COLUMNS - 1)
            total, darkest, brightest = 0, 255, 0
            for y in range(top, top + BLOCK):
                for x in range(left, left + BLOCK):
                    a = (np.int32(gray[y - 1, x - 1]) - 2 * np.int32(gray[y - 1, x])
                         + np.int32(gray[y - 1, x + 1]))
                    b = (np.int32(gray[y, x - 1]) - 2 * np.int32(gray[y, x])
                         + np.int32(gray[y, x + 1]))
                    c = (np.int32(gray[y + 1, x - 1]) - 2 * np.int32(gray[y + 1, x])
                         + np.int32(gray[y + 1, x + 1]))
                    total += abs(a - 2 * b + c)
                    darkest = min(darkest, gray[y, x])
                    brightest = max(brightest, gray[y, x])
            if darkest > 0 and brightest < 255:
                responses[count] = total / BLOCK ** 2
                count += 1
    return count


def blur(least: float, noise: float) -> float:
    """Return the standard deviation in px of the blur that an image with such noise needs."""
    return math.hypot(least, min(BLUR * noise, MOST_BLUR))


def of_gradient(noise: float, blur_sigma: float) -> float:
    """
    Return the noise of dx and dy in grey levels after a Gaussian blur.

    White noise through the derivative of a Gaussian of variance v has the variance 1 / (8 pi v^2);
    Sobel's is about one of variance 0.42, and twice that of the grey levels for each pixel.
    """
    return 2 * noise / (math.sqrt(8 * math.pi) * (blur_sigma ** 2 + 0.42))


def estimate(gray: np.ndarray) -> float:
    """
    Return the standard deviation of the noise of an image in grey levels.

    ``gray`` is a (H, W) uint8 array.  Where there is no block to look at, since the image is too
    small or saturated everywhere, it is 0.
    """
    if min(gray.shape) < BLOCK + 2:
        return 0.0
    responses = np.empty(ROWS * COLUMNS)
    count = _responses(gray, responses)
    if count == 0:
        return 0.0
    place = int(FLATTEST * count)
    return GAIN * float(np.partition(responses[:count], place)[place])
