"""One image and its thresholds, as the stages of detection use them."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from qflsd_ros.core.circle import CurvatureLimits, LensPrior, UNKNOWN_LENS
from qflsd_ros.core.detection.region import Region
from qflsd_ros.core.lens.division import DivisionModel

# Standard deviation of a known lambda of 0: real lenses deviate from the division model by about
# as much (see DivisionModel.of_camera).
KNOWN_STD = 0.02


class Frame(NamedTuple):
    """The gradients of one image, and its noise and contrast."""

    dx: np.ndarray          # (H, W) int16 gradients, in units of 1 / gradients.GAIN grey levels
    dy: np.ndarray
    region: Region          # where arcs may be
    noise: float            # standard deviation of the gradients, grey levels
    blur: float             # standard deviation of the Gaussian before the gradients, px
    low: float              # contrast down to which a chain continues, grey levels
    high: float             # contrast of a clear edge: of one pixel of each chain, grey levels


class Limits(NamedTuple):
    """The limits of one frame that decide which arcs are found."""

    min_points: int         # edge points of the shortest piece
    min_seed: float         # px, of the longest piece of an arc
    min_length: float       # px
    min_score: float
    min_distance: float     # px, between parallel arcs
    max_gap: float          # px, between two pieces of an arc
    tolerance: float        # px, largest distance of an edge point from its arc
    bend: CurvatureLimits           # of arcs
    free_bend: CurvatureLimits      # of pieces: the same without a lens


def lens_prior(lens: DivisionModel | None) -> LensPrior:
    """Return a lens as the kernels use it; None is an unknown lens."""
    if lens is None:
        return UNKNOWN_LENS
    # A change of lambda by this deviation displaces points by the same length at any lambda.
    std = KNOWN_STD * (1 - lens.lam / 3) ** 2
    return LensPrior(*lens.in_pixels, std / lens.half_diagonal ** 2)


def curvature_limits(significance: float, maximum: float,
                     lens: DivisionModel | None) -> tuple[CurvatureLimits, CurvatureLimits]:
    """Return the limits for arcs through a lens, and for pieces of them."""
    return (CurvatureLimits(significance, maximum, lens_prior(lens)),
            CurvatureLimits(significance, maximum, UNKNOWN_LENS))
