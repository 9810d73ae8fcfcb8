"""The synthetic scene: a furnished room seen by a moving camera, with its exact arcs."""
from __future__ import annotations

from collections.abc import Iterator
import itertools
import math

import numpy as np

from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.sources.files import encoding
from qflsd_ros.sources.frames import Frame, report_by_log, Source
from qflsd_ros.sources.scene import room
from qflsd_ros.sources.scene.optics import Camera
from qflsd_ros.sources.scene.raycast import render, TEXTURE_SIZE
from qflsd_ros.sources.scene.solids import edges, front_faces, surfaces
from qflsd_ros.sources.scene.truth import visible_arcs

FRAMES_PER_TURN = 1200      # after which the camera is where it started
LUMA = np.array([[0.114], [0.587], [0.299]])


class Scene:
    """
    A camera that moves through a room: a picture for every frame number, always the same bits.

    Edges lie where the truth says to within 0.02 px, with (0, 0) at the centre of the top-left
    pixel.

    Parameters
    ----------
    width, height
        Size of the image in px, at least 1.
    lam
        Lambda of the division model, normalised as in :mod:`qflsd_ros.core.lens.division`.
    noise
        Standard deviation of the image noise in grey levels.
    seed
        Start of the noise, the texture, and the shades of floor boards and books.
    colour
        Whether images are (H, W, 3), blue, green, red, instead of (H, W).

    Raises
    ------
    ValueError
        Lambda is outside -1 to 0.5, where the lens does not show all of the image.

    """

    def __init__(self, width: int = 640, height: int = 480, lam: float = -0.5, noise: float = 2.0,
                 seed: int = 0, colour: bool = False) -> None:
        if not -1 <= lam <= 0.5:
            raise ValueError(f'lam is {lam}: must lie in -1 to 0.5')
        self.lens = DivisionModel(lam, (height, width))
        self.seed, self.colour = seed, colour
        self._boxes = room.furnish(seed)
        self._edges = edges(self._boxes)
        # An edge of a patch has one face: it stands for both.
        self._edge_faces = np.array([(6 * edge.box + edge.faces[0], 6 * edge.box + edge.faces[-1])
                                     for edge in self._edges])
        self._edge_ends = np.array([(edge.start, edge.end) for edge in self._edges])
        self._surfaces = surfaces(self._boxes, room.LAMP)
        self._texture = _texture(seed)
        # Each frame has its own stretch of it: fresh noise would cost as much as half the frame.
        pool = 2 * height * width * (3 if colour else 1) + 65536
        self._noise = np.float32(noise) * np.random.default_rng((seed, 2)).standard_normal(
            pool, np.float32)

    def frame(self, number: int) -> tuple[np.ndarray, Arcs]:
        """Return a frame's image and its exact arcs."""
        return self.image(number), self.truth(number)

    def image(self, number: int) -> np.ndarray:
        """Return a frame's image, (H, W) uint8 or, in colour, (H, W, 3)."""
        shape = *self.lens.shape, 3 if self.colour else 1
        size = math.prod(shape)
        first = np.random.default_rng((self.seed, number)).integers(len(self._noise) - size + 1)
        image = self._render(number, self._noise[first:first + size].reshape(shape))
        return image if self.colour else image[..., 0]

    def truth(self, number: int) -> Arcs:
        """
        Return the exact arc of every visible piece of an edge, at least 1 px long.

        Those of little ``contrast`` in their table lie between surfaces of nearly the same shade.
        """
        clean = self._render(number, np.zeros((*self.lens.shape, 1), np.float32))
        return visible_arcs(self._edges, self._boxes, self._camera(number), clean[..., 0])

    def _camera(self, number: int) -> Camera:
        return Camera(self.lens, *room.viewpoint(number / FRAMES_PER_TURN))

    def _render(self, number: int, noise: np.ndarray) -> np.ndarray:
        camera = self._camera(number)
        front = front_faces(self._boxes, camera.position).ravel()
        lines = self._edge_ends[front[self._edge_faces].any(axis=1)]
        boxes = self._surfaces.boxes.copy()
        boxes[['eye_x', 'eye_y', 'eye_z']] = [tuple(box.local(camera.position))
                                              for box in self._boxes]
        colours = self._surfaces.colours
        return render(self._surfaces._replace(boxes=boxes), lines, camera,
                      colours if noise.shape[2] == 3 else colours @ LUMA, self._texture, noise)


class SceneFrames(Source):
    """The scene as a source that never ends."""

    on_demand = True

    def __init__(self, scene: Scene) -> None:
        super().__init__('scene', report_by_log)
        self._scene = scene

    def warm_up(self) -> None:
        """Compile the kernels, or load them from disk."""
        self._scene.image(0)

    def _frames(self) -> Iterator[Frame]:
        for number in itertools.count():
            yield Frame.of(self._scene.image(number), encoding(self._scene.colour),
                           f'frame {number}')


def _texture(seed: int) -> np.ndarray:
    """Return a cloudy pattern of mean 0 and standard deviation 1 that repeats in both ways."""
    random = np.random.default_rng((seed, 1))
    spectrum = np.fft.fft2(random.standard_normal((TEXTURE_SIZE, TEXTURE_SIZE)))
    frequency = np.fft.fftfreq(TEXTURE_SIZE, 1 / TEXTURE_SIZE)
    pattern = np.fft.ifft2(spectrum / (4 + np.hypot(frequency[:, None], frequency))).real
    return np.clip(pattern / pattern.std(), -2.5, 2.5).astype(np.float32)
