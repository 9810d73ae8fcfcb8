"""
A photograph seen by a camera that turns about its centre.

Frames are cut, three quarters as wide and high, out of the photograph, with fresh noise and a
drifting gain.  The place of a point in every other frame is known exactly.
"""
from __future__ import annotations

from benchmark.metrics import Samples
import cv2
import numpy as np
from qflsd_ros.core import DivisionModel

SHARE = 0.75                # of width and height that a frame shows
# Half diagonals.  Any focal length makes an exact sequence; this one is that of the photographs of
# York Urban, and larger ones of a fisheye would turn the camera by a few px only.
FOCAL = 1.7
# Degrees and cycles in 60 frames, about the x axis, the y axis and the optical axis.
SWING = np.array([5.0, 6.0, 5.0])
CYCLES = np.array([1.4, 1.0, 0.8])
WITHIN = 0.8                # of the margin around a frame, largest turn
GAIN, NOISE = 0.15, 2.0     # share, grey levels
BORDER = 4.0                # px from the border of a frame, in which no line can be asked for


class Turning:
    """
    Frames of the camera, and the places of points in all of them.

    Parameters
    ----------
    gray
        (H, W) uint8, the photograph.
    lam
        Lambda of its lens by the division model.
    frames
        Number of frames.
    speed
        1: up to a degree a frame.

    """

    def __init__(self, gray: np.ndarray, lam: float, frames: int, speed: float) -> None:
        self._gray, self._lens = gray, DivisionModel(lam, (gray.shape[0], gray.shape[1]))
        size = np.array(gray.shape[::-1])
        self.size = np.rint(size * SHARE).astype(int)
        self._shift = (size - self.size) / 2
        time = np.arange(frames) / 60 * speed
        margin = np.rad2deg(np.arctan(1 / FOCAL)) * (1 - SHARE) * WITHIN
        swing = np.minimum(SWING, [0.75 * margin, margin, SWING[2]])
        phase = np.random.default_rng(0).uniform(0, 2 * np.pi, 3)
        angles = np.deg2rad(swing) * np.sin(2 * np.pi * CYCLES * time[:, None] + phase)
        self._turns = [cv2.Rodrigues(np.array([x, y, 0.0]))[0]
                       @ cv2.Rodrigues(np.array([0.0, 0.0, z]))[0] for x, y, z in angles]
        self._gain = 1 + GAIN * np.sin(2 * np.pi * 0.7 * time)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._turns)

    def frame(self, i: int) -> np.ndarray:
        """Return frame i, (H, W) uint8, the same at each call."""
        grid = np.stack(np.meshgrid(*map(np.arange, self.size)), axis=-1).reshape(-1, 2)
        rays = self._rays(grid.astype(float)) @ self._turns[i].T
        source = (self._points(rays) + self._shift).astype(np.float32)
        x, y = source.reshape(*self.size[::-1], 2).transpose(2, 0, 1)
        image = cv2.remap(self._gray, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        noise = np.random.default_rng(i).normal(0, NOISE, image.shape)
        return np.clip(np.rint(image * self._gain[i] + noise), 0, 255).astype(np.uint8)

    def carry(self, pieces: Samples, i: int, j: int) -> np.ndarray:
        """Return the middles (N, 2) px of pieces of frame i in frame j; nan where not in sight."""
        there = self._points(self._rays(pieces.points) @ self._turns[i].T @ self._turns[j])
        inside = np.all((there >= BORDER) & (there <= self.size - 1 - BORDER), axis=1)
        return np.where(inside[:, None], there, np.nan)

    def _rays(self, points: np.ndarray) -> np.ndarray:
        """Return viewing directions (N, 3) of points of a frame, (N, 2) px."""
        q = (points + self._shift - self._lens.origin) / self._lens.half_diagonal
        depth = FOCAL * (1 + self._lens.lam * (q ** 2).sum(axis=1, keepdims=True))
        return np.hstack([q, depth])

    def _points(self, rays: np.ndarray) -> np.ndarray:
        """Return the points of a frame, (N, 2) px, in viewing directions."""
        side, depth = rays[:, :2], rays[:, 2:] / FOCAL
        root = np.sqrt(np.maximum(depth ** 2 - 4 * self._lens.lam
                                  * (side ** 2).sum(axis=1, keepdims=True), 0))
        q = 2 * side / np.maximum(depth + root, 1e-9)
        return q * self._lens.half_diagonal + self._lens.origin - self._shift
