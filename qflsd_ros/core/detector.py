"""The detector: calls the stages from a grey image to its arcs, Steps 1 to 6 of the paper."""
from __future__ import annotations

from collections.abc import Callable
import math

import cv2
import numpy as np

from qflsd_ros.core import paper
from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.circle import FIT_SIZE
from qflsd_ros.core.detection import assembly, extraction, refinement
from qflsd_ros.core.detection.contours import chains, edges, gradients, noise, thresholds
from qflsd_ros.core.detection.frame import curvature_limits, Frame, Limits
from qflsd_ros.core.detection.image_circle import find_image_circle, ImageCircle
from qflsd_ros.core.detection.joining import joining, pieces
from qflsd_ros.core.detection.region import Disc, Region, region, within
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.parameters import Parameters

# All of these are chosen, not tuned, unless stated otherwise.
MIN_POINTS = 8              # edge points of the shortest piece of an arc in an image without noise
# Shortest piece from which an arc is made, px for each edge point of the shortest piece (tuned on
# photographs: with 1.25, sides of 17 px are found as often, and it takes 2 % longer).
SEED = 1.5
SIGNIFICANCE = 2.3          # standard deviations from which on an arc is not straight
MOST_PIXELS = 2 ** 31       # of an image: they are numbered in 32 bits
SMALLEST_IMAGE = 3          # px, of a side; there are no edges in less


class Detector:
    """
    Detects the images of straight edges through any lens, as circular arcs.

    A detector reuses its memory from frame to frame: use one for each thread.  Its attribute
    ``parameters`` may be replaced between two frames.

    Attributes
    ----------
    on_stage
        Called with the name of each stage of method arcs when the stage ends, unless None.
    frame
        The gradients and thresholds of the last frame, until the next one.  None before the first
        frame, after an image with a side below 3 px, and with method paper.
    circle
        The image circle of the last frame; None where none was found or looked for.

    """

    def __init__(self, parameters: Parameters | None = None) -> None:
        """Take parameters (None: the defaults); nothing is compiled yet, see :meth:`warm_up`."""
        self.parameters = Parameters() if parameters is None else parameters
        self.on_stage: Callable[[str], None] | None = None
        self.frame: Frame | None = None
        self.circle: ImageCircle | None = None
        self._memory = _Memory(0, 0)

    def warm_up(self) -> None:
        """Compile the kernels, or load compiled ones from disk, before the first frame."""
        Detector().detect(example()).vertices()

    def detect(self, gray: np.ndarray, mask: np.ndarray | None = None,
               lens: DivisionModel | None = None) -> Arcs:
        """
        Find the arcs of one image.

        Parameters
        ----------
        gray
            (H, W) uint8, any strides.
        mask
            (H, W) uint8 or bool, 0 at masked pixels; None masks no pixel.  No point of an arc lies
            on a masked pixel.  Gradients within 3 px (:data:`region.MARGIN`) of masked pixels are
            ignored, since the rim of the mask is no edge, and masked pixels do not affect the
            estimates of noise, contrast and texture.  Pass the same array for successive frames,
            and do not change it: it is evaluated once for each new array.
        lens
            The lens of the image if it is known, for instance from the arcs of earlier frames.
            Then two points of a window suffice for a hypothesis, gaps between images of straight
            edges need less support, and arcs whose curvature does not differ significantly get
            that of a straight edge.  Method paper ignores it.

        Returns
        -------
        The arcs; the same image, mask, lens and parameters give the same arcs, bit for bit.

        Raises
        ------
        TypeError
            ``gray`` is not an array of uint8, or ``mask`` is not an array.
        ValueError
            ``gray`` does not have two dimensions, is empty, or has 2^31 pixels or more; ``mask``
            or ``lens`` has another shape; or ``mask`` is given with method paper.

        """
        _check(gray, mask, lens)
        self.frame = self.circle = None
        if min(gray.shape) < SMALLEST_IMAGE:
            return Arcs.empty()
        gray = _read_only(gray)
        if self.parameters.method == 'paper':
            if mask is not None:
                raise ValueError('mask is given: method paper has none, leave it out or use arcs')
            return paper.detect(gray, self.parameters)
        if self._memory.shape != gray.shape:
            self._memory = _Memory(*gray.shape)
        return self._detect(gray, self._memory.region(mask), lens)

    def look(self, gray: np.ndarray, mask: np.ndarray | None = None) -> None:
        """
        Replace ``frame`` by that of the next image without detecting arcs.

        The next image has the size of the last one, whose noise and thresholds it keeps, since
        both change slowly.  Arguments and errors are those of :meth:`detect`; ValueError if there
        is no ``frame`` or it has another size.
        """
        _check(gray, mask, None)
        if self.frame is None or self.frame.dx.shape != gray.shape:
            last = 'which there is not yet' if self.frame is None else self.frame.dx.shape
            raise ValueError(f'image has shape {gray.shape}: must be that of the last image, '
                             f'{last}')
        memory, gray = self._memory, _read_only(gray)
        gradients.compute(gray, self.frame.blur, memory.dx, memory.dy)
        self.frame = self.frame._replace(region=self._in_circle(gray, memory.region(mask)))

    def _in_circle(self, gray: np.ndarray, where: Region) -> Region:
        """Return the part of a region in the image circle, all of it where there is none."""
        if self.parameters.image_circle == 'off':
            self.circle = None
        else:
            self.circle = find_image_circle(gray, where)
        if self.circle is None:
            return where
        return self._memory.within(where, self.circle.clear)

    def _detect(self, gray: np.ndarray, where: Region, lens: DivisionModel | None) -> Arcs:
        """Find the arcs of a region, stage by stage."""
        memory = self._memory
        grain = noise.estimate(gray, where)
        limits = self._limits(grain, lens)
        self._ended('noise')
        self.frame = frame = self._compute_frame(gray, where, grain)
        self._ended('gradients')
        memory.reserve(edges.find(frame, memory.rows, memory.edges, memory.around))
        self._ended('edges')
        offsets = self._trace(frame, limits.min_points)
        self._ended('chains')
        count = extraction.extract(memory.points, offsets, limits, memory.todo, memory.runs,
                                   memory.fits)
        found_pieces = pieces.describe(memory.points, memory.runs[:count], memory.fits[:count],
                                       memory.pieces)
        self._ended('extraction')
        joined = joining.join(found_pieces, memory.joining, frame, limits)
        self._ended('joining')
        found = assembly.candidates(found_pieces, joined)
        assembly.validate(found, found_pieces, memory.points, frame, limits,
                          limits.min_length - refinement.SHIFT)
        self._ended('validation')
        assembly.separate(found, gray.shape, limits.min_distance)
        self._ended('suppression')
        kept = assembly.gather(found, found_pieces.runs, memory.points, memory.pixels,
                               gray.shape[1])
        arcs = refinement.refine(kept, frame, limits)
        self._ended('refinement')
        return arcs

    def _limits(self, grain: float, lens: DivisionModel | None) -> Limits:
        """Return the limits for an image whose noise is ``grain`` grey levels."""
        parameters, min_points = self.parameters, noise.min_points(MIN_POINTS, grain)
        return Limits(min_points, SEED * min_points, parameters.min_length, parameters.min_score,
                      parameters.min_distance, parameters.max_gap, parameters.tolerance,
                      *curvature_limits(SIGNIFICANCE, self._max_curvature(), lens))

    def _compute_frame(self, gray: np.ndarray, where: Region, grain: float) -> Frame:
        """
        Compute the gradients, and the thresholds for them (Step 1).

        Noise and thresholds are those of all the region, also outside of its image circle, so that
        the circle changes no arc inside but those that were joined to arcs at the rim, or
        suppressed by them.
        """
        memory, parameters = self._memory, self.parameters
        blur_sigma = noise.blur(parameters.blur_sigma, grain)
        gradients.compute(gray, blur_sigma, memory.dx, memory.dy)
        # After the gradients: single lines of the image are read faster from the cache.
        strength = thresholds.estimate(gray, where)
        gradient_noise = noise.of_gradient(grain, blur_sigma)
        scale = thresholds.scale(strength, gradient_noise, parameters.contrast_high)
        return Frame(memory.dx, memory.dy, self._in_circle(gray, where), gradient_noise,
                     blur_sigma, scale * parameters.contrast_low, scale * parameters.contrast_high)

    def _trace(self, frame: Frame, min_points: int) -> np.ndarray:
        """Write the chains of edge points to memory; return the offsets of chains, (N + 1,)."""
        memory = self._memory
        image = chains.edge_map(memory.flat, memory.around, frame.dx, frame.dy)
        count = chains.trace(image, memory.words, min_points, memory.pixels, memory.offsets)
        edges.locate(image.dx, image.dy, image.width, memory.pixels, memory.offsets[count],
                     memory.points)
        return memory.offsets[:count + 1]

    def _ended(self, stage: str) -> None:
        """Call ``on_stage``, if there is one, at the end of a stage."""
        if self.on_stage is not None:
            self.on_stage(stage)

    def _max_curvature(self) -> float:
        """
        Return the largest curvature of an arc, 1/px.

        Equation (4) has the radius sqrt((e^2 + f^2) / 4 - 1 / lambda) >= 1 / sqrt(-lambda): the
        picture of a straight edge cannot be bent more, whatever lies in the image.
        """
        return 1 / (self.parameters.min_radius * math.hypot(*self._memory.shape) / 2)


def example() -> np.ndarray:
    """Return an image with an image circle and edges, (64, 64) uint8, to warm up with."""
    gray = cv2.circle(np.zeros((64, 64), np.uint8), (32, 32), 27, 100, cv2.FILLED)
    gray[18:46, 18:46] = 255
    return gray


def _read_only(gray: np.ndarray) -> np.ndarray:
    """
    Return a view of an image in C order that cannot be written.

    Kernels are compiled for one type of array: that of a message or a bag is read-only.
    """
    view = np.ascontiguousarray(gray).view()
    view.flags.writeable = False
    return view


def _check(gray: np.ndarray, mask: np.ndarray | None, lens: DivisionModel | None) -> None:
    if not isinstance(gray, np.ndarray) or gray.dtype != np.uint8:
        came = f'{gray.dtype} array' if isinstance(gray, np.ndarray) else type(gray).__name__
        raise TypeError(f'image is a {came}: must be a uint8 array of shape (height, width)')
    if gray.ndim != 2 or gray.size == 0:
        raise ValueError(f'image has shape {gray.shape}: must be (height, width), both above 0; '
                         'convert colour to grey first')
    if gray.size >= MOST_PIXELS:
        raise ValueError(f'image has {gray.size} pixels: must be below {MOST_PIXELS}')
    if not (mask is None or isinstance(mask, np.ndarray)):
        raise TypeError(f'mask is a {type(mask).__name__}: must be an array of shape '
                        f'{gray.shape}, or None')
    if mask is not None and mask.shape != gray.shape:
        raise ValueError(f'mask has shape {mask.shape}: must be {gray.shape}, as the image')
    if lens is not None and tuple(lens.shape) != gray.shape:
        raise ValueError(f'lens is for images of shape {lens.shape}: must be {gray.shape}, as the '
                         'image')


class _Memory:
    """The arrays that images of one size need, kept from frame to frame."""

    def __init__(self, height: int, width: int) -> None:
        self.shape = height, width
        self.dx, self.dy = np.empty(self.shape, np.int16), np.empty(self.shape, np.int16)
        self.rows = edges.Rows(np.empty((3, width), np.int32), np.empty(width, np.uint8))
        self.flat = np.zeros((height * width + 7) // 8 * 8, np.uint8)
        self.words = self.flat.view(np.uint64)
        self.edges = self.flat[:height * width].reshape(self.shape)
        self.around = np.empty(self.shape, np.uint8)
        self._mask: np.ndarray | None = None
        self._region = region(self.shape, None)
        self._disc_pixels = np.empty((2, height, width), np.bool_)
        self._disc: tuple[Region, Disc] | None = None
        self._disc_region = self._region
        self.pixels = np.empty(0, np.int32)
        self.reserve(1)

    def region(self, mask: np.ndarray | None) -> Region:
        """Return the region of a mask; it is computed again only for another array."""
        if mask is not self._mask:
            self._mask, self._region = mask, region(self.shape, mask)
        return self._region

    def within(self, where: Region, disc: Disc) -> Region:
        """Return the part of a region in a disc; it is computed again only for other ones."""
        if self._disc is None or self._disc[0] is not where or self._disc[1] != disc:
            self._disc = where, disc
            self._disc_region = within(where, disc, self._disc_pixels)
        return self._disc_region

    def reserve(self, edge_pixels: int) -> None:
        """Make room for ``edge_pixels``; arrays that are too small grow to 1.5 times that."""
        if edge_pixels <= len(self.pixels):
            return
        size = edge_pixels + edge_pixels // 2
        self.pixels = np.empty(size, np.int32)
        self.points = np.empty((4, size), np.float32)
        most = size // noise.FEWEST + 2
        self.offsets = np.empty(most, np.int64)
        self.todo, self.runs = np.empty((most, 3), np.int64), np.empty((most, 2), np.int64)
        self.fits = np.empty((most, FIT_SIZE))
        self.pieces, self.joining = pieces.piece_memory(most), joining.Memory(most)
