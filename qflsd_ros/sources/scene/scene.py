"""The synthetic scene: images of a furnished room from a moving camera, with their exact arcs."""
from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
import itertools
import math

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.sources.files import encoding
from qflsd_ros.sources.frames import Frame, Report, report_by_log, Source
from qflsd_ros.sources.scene import room
from qflsd_ros.sources.scene.optics import calibration, Camera
from qflsd_ros.sources.scene.raycast import render, TEXTURE_SIZE
from qflsd_ros.sources.scene.solids import Box, Edge, edges, front_faces, surfaces
from qflsd_ros.sources.scene.truth import visible_arcs

FRAMES_PER_TURN = 1200      # frames of the closed path: 40 s at 30 Hz, a walk around the room
ACCURATE = 0.1              # px, that of edge points on photographs (STRAY of lens/observation)
# Values of noise that are kept, 34 MB.  Images of more values, such as 4K in grey, repeat them.
# Chosen, not tuned.
MOST_NOISE = 2 ** 23
# Weights of blue, green, red in grey levels (ITU-R BT.601), as OpenCV converts colours.
LUMA = np.array([[0.114], [0.587], [0.299]])


class Scene:
    """
    A camera that moves through a room; each frame number gives an image, bit for bit the same.

    The edges of the image agree with the exact arcs within 0.02 px; (0, 0) is the centre of the
    top-left pixel.

    Parameters
    ----------
    width, height
        Size of the image in px, at least 1.
    lam
        Lambda of the division model, normalised as in :mod:`qflsd_ros.core.lens.division`.
    noise
        Standard deviation of the image noise in grey levels.
    seed
        Seed of the noise, the texture, and the shades of floor boards and books.
    colour
        Whether images are (H, W, 3), blue, green, red, instead of grey (H, W).

    Raises
    ------
    ValueError
        Lambda is outside -1 to 0.5, the range in which every pixel has a viewing direction.

    """

    def __init__(self, width: int = 640, height: int = 480, lam: float = -0.5, noise: float = 2.0,
                 seed: int = 0, colour: bool = False) -> None:
        if not -1 <= lam <= 0.5:
            raise ValueError(f'lam is {lam}: must lie in -1 to 0.5')
        self.lens = DivisionModel(lam, (height, width))
        self.seed, self.colour = seed, colour
        self._boxes, self._edges = _furnished(seed)
        # An edge of a patch has only one face, which fills both columns.
        self._edge_faces = np.array([(6 * edge.box + edge.faces[0], 6 * edge.box + edge.faces[-1])
                                     for edge in self._edges])
        self._edge_ends = np.array([(edge.start, edge.end) for edge in self._edges])
        self._surfaces = surfaces(self._boxes, room.LAMP)
        self._texture = _texture(seed)
        # Each frame takes a random section of this noise: new noise for each frame would take half
        # as long as rendering.
        pool = min(2 * height * width * (3 if colour else 1) + 65536, MOST_NOISE)
        self._noise = np.random.default_rng((seed, 2)).standard_normal(pool, np.float32)
        self._noise *= np.float32(noise)

    def frame(self, number: int) -> tuple[np.ndarray, Arcs]:
        """Return a frame's image and its exact arcs."""
        return self.image(number), self.truth(number)

    def image(self, number: int) -> np.ndarray:
        """Return a frame's image: (H, W) uint8, or (H, W, 3) blue, green, red in colour."""
        size = math.prod(self.lens.shape) * (3 if self.colour else 1)
        # Of noise for less than an image the second half at least, which is repeated.
        used = min(size, len(self._noise) // 2)
        first = np.random.default_rng((self.seed, number)).integers(len(self._noise) - used + 1)
        image = self._render(number, self._noise[first:first + size], self.colour)
        return image if self.colour else image[..., 0]

    def truth(self, number: int) -> Arcs:
        """
        Return the exact arcs of all visible pieces of edges that are at least 1 px long.

        An arc with a low ``contrast`` in its table separates surfaces of nearly the same shade;
        its ``track`` is the number of its edge, from 1, in all frames: row ``track - 1`` of
        :attr:`edges`.
        """
        clean = self._render(number, np.zeros(1, np.float32), colour=False)
        return visible_arcs(self._edges, self._boxes, self._camera(number), clean[..., 0])

    @property
    def edges(self) -> np.ndarray:
        """Return starts and ends of all edges of the room, hidden ones too: (N, 2, 3) m."""
        return self._edge_ends.copy()

    def pose(self, number: int) -> np.ndarray:
        """Return a frame's pose: (4, 4) float64, from the optical frame to the room, m."""
        return self._camera(number).pose()

    def _camera(self, number: int) -> Camera:
        return Camera(self.lens, *room.viewpoint(number / FRAMES_PER_TURN))

    def _render(self, number: int, noise: np.ndarray, colour: bool) -> np.ndarray:
        camera = self._camera(number)
        front = front_faces(self._boxes, camera.position).ravel()
        lines = self._edge_ends[front[self._edge_faces].any(axis=1)]
        boxes = self._surfaces.boxes.copy()
        boxes[['eye_x', 'eye_y', 'eye_z']] = [tuple(box.local(camera.position))
                                              for box in self._boxes]
        colours = self._surfaces.colours
        return render(self._surfaces._replace(boxes=boxes), lines, camera,
                      colours if colour else colours @ LUMA, self._texture, noise)


class SceneFrames(Source):
    """
    The scene as an endless source.

    ``camera`` is its lens in the terms of CameraInfo; a difference of more than the accuracy of
    edges is reported.
    """

    on_demand = True
    posed = True

    def __init__(self, scene: Scene, report: Report = report_by_log) -> None:
        super().__init__('scene', report)
        self._scene = scene
        self.frame_size = math.prod(scene.lens.shape) * (3 if scene.colour else 1)
        terms = calibration(scene.lens)
        self.camera = CameraModel(terms.distortion_model, terms.matrix, terms.coefficients)
        if terms.residual > ACCURATE:
            report(f'scene: camera_info differs from the lens by up to {terms.residual:.2f} px: '
                   f'no model of CameraInfo fits lam {scene.lens.lam:g} better')

    def warm_up(self) -> None:
        """Compile the kernels of the renderer, or load them from the cache."""
        self._scene.image(0)

    def _frames(self) -> Iterator[Frame]:
        for number in itertools.count():
            yield Frame.of(self._scene.image(number), encoding(self._scene.colour),
                           f'frame {number}', pose=self._scene.pose(number))


@lru_cache(maxsize=4)  # seeds at a time; finding the edges takes a quarter of a second
def _furnished(seed: int) -> tuple[list[Box], list[Edge]]:
    """Return the boxes of the room, and their edges; scenes of one seed share them."""
    boxes = room.furnish(seed)
    return boxes, edges(boxes)


def _texture(seed: int) -> np.ndarray:
    """
    Return a cloudy texture: periodic in both directions, mean 0, standard deviation 1.

    It is white noise filtered by 1 / (4 + f) at the frequency f in periods per texture.
    """
    random = np.random.default_rng((seed, 1))
    spectrum = np.fft.fft2(random.standard_normal((TEXTURE_SIZE, TEXTURE_SIZE)))
    frequency = np.fft.fftfreq(TEXTURE_SIZE, 1 / TEXTURE_SIZE)
    pattern = np.fft.ifft2(spectrum / (4 + np.hypot(frequency[:, None], frequency))).real
    return np.clip(pattern / pattern.std(), -2.5, 2.5).astype(np.float32)
