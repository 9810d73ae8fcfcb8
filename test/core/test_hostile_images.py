"""
Images made to mislead or to cost: every arc is sound, time and memory are bounded.

Against photographs of the same size none of these patterns took more than 7 times as long
(checkers of one pixel at 640x480; half of them took no longer at all), and no image of 7680x4320
more than 26 bytes for each pixel.
"""
from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
import os
from pathlib import Path
import subprocess
import sys
import time

import cv2
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core import Detector, Parameters
from scenery import noise, scene
from soundness import assert_sound

pytestmark = pytest.mark.slow
SHAPE = (200, 260)
SENSITIVE = Parameters(blur_sigma=0.0, contrast_high=1.0, contrast_low=0.5, min_length=3.0,
                       min_score=-1000.0)
MOST_TIME = 40          # times that of a scene of the same size
MOST_MEMORY = 40        # bytes for each pixel


def two_tone(bright: np.ndarray) -> np.ndarray:
    return np.where(bright, 220, 30).astype(np.uint8)


def serpentine(width: int, height: int, pitch: int, tooth: int) -> np.ndarray:
    """Return one jagged line that goes back and forth over the whole image."""
    points = []
    for i, y in enumerate(range(pitch, height - pitch, pitch)):
        x = np.arange(pitch, width - pitch, max(tooth, 4))
        row = np.column_stack([x, y + tooth * (np.arange(len(x)) % 2)])
        points.append(row[::1 - 2 * (i % 2)])
    gray = np.full((height, width), 30, np.uint8)
    cv2.polylines(gray, [np.concatenate(points)], False, 220, max(2, pitch // 4))
    return gray


def even(phase: np.ndarray) -> np.ndarray:
    """Return stripes, (H, W) uint8: bright where the whole part of a phase is even."""
    return two_tone(np.floor(phase) % 2 == 0)


# By x, y from the image's centre, and r, a around it; a is in turns.
PATTERNS: dict[str, Callable[..., np.ndarray]] = {
    **{f'checkers of {n}': lambda x, y, r, a, n=n: even(x // n + y // n)
       for n in (1, 2, 3, 4, 8, 16)},
    **{f'stripes of {n}': lambda x, y, r, a, n=n: even(x / n) for n in (1, 2, 3, 5)},
    **{f'diagonals of {n}': lambda x, y, r, a, n=n: even((x + y) / n) for n in (2, 4, 13)},
    **{f'rings of {n}': lambda x, y, r, a, n=n: even(r / n) for n in (3, 4, 10, 30)},
    **{f'star of {n}': lambda x, y, r, a, n=n: even(2 * n * a) for n in (8, 64, 500)},
    **{f'spiral of {n}': lambda x, y, r, a, n=n: even(r / n + 2 * a) for n in (3, 15)},
    'spiral with corners': lambda x, y, r, a: even(np.maximum(abs(x), abs(y)) / 4 + 2 * a),
    'growing spiral': lambda x, y, r, a: even(8 * np.log(r + 1) + 6 * a),
    'zone plate': lambda x, y, r, a: np.uint8(128 + 120 * np.cos(1.5 * r ** 2 / r.max())),
    'closed circle': lambda x, y, r, a: two_tone(r < 0.8 * y.max()),
    'thin circle': lambda x, y, r, a: two_tone(abs(r - 0.8 * y.max()) < 1.5),
    'notched circle': lambda x, y, r, a: two_tone(
        (r < 0.8 * y.max()) & (np.hypot(x - 0.8 * y.max(), y) > 6)),
    'lines across it all': lambda x, y, r, a: two_tone((abs(x + 0.7 * y) < 1) | (abs(y) < 1)),
    'mesh': lambda x, y, r, a: two_tone((x % 12 < 2) | (y % 12 < 2)),
    'hatching': lambda x, y, r, a: two_tone(((x + y) % 13 < 2) | ((x - y) % 11 < 2)),
    'dots': lambda x, y, r, a: two_tone((x % 6 - 3) ** 2 + (y % 6 - 3) ** 2 < 4),
    'bricks': lambda x, y, r, a: two_tone((y % 16 < 2) | ((x + y // 16 % 2 * 16) % 32 < 2)),
    'zigzag': lambda x, y, r, a: even((y + abs(x % 40 - 20)) // 6),
    'waves': lambda x, y, r, a: even((y + 6 * np.sin(x / 4)) / 12),
    'ramp': lambda x, y, r, a: np.uint8(255 * (x - x.min()) / max(np.ptp(x), 1)),
    'serpentine': lambda x, y, r, a: serpentine(x.shape[1], y.shape[0], 8, 0),
    'jagged serpentine': lambda x, y, r, a: serpentine(x.shape[1], y.shape[0], 32, 20),
    'noise of two greys': lambda x, y, r, a: two_tone(
        np.random.default_rng(0).random(r.shape) < 0.5),
    'white noise': lambda x, y, r, a: np.random.default_rng(0).integers(
        0, 256, r.shape, np.uint8),
    'noise of every grain': lambda x, y, r, a: noise(0, r.shape)}


@lru_cache(maxsize=1)
def coordinates(shape: tuple[int, int]) -> tuple[np.ndarray, ...]:
    """Return x, y, r and a of an image, each (H, W) float32."""
    height, width = shape
    y, x = np.mgrid[:height, :width].astype(np.float32)
    x, y = x - width // 2, y - height // 2
    return x, y, np.hypot(x, y), np.arctan2(y, x) / (2 * np.pi)


def pattern(name: str, shape: tuple[int, int]) -> np.ndarray:
    return PATTERNS[name](*coordinates(shape))


def seconds(detector: Detector, gray: np.ndarray) -> float:
    """Return the CPU time of a detection."""
    start = time.process_time()
    detector.detect(gray)
    return time.process_time() - start


@pytest.mark.parametrize('name', PATTERNS)
def test_arcs_are_sound(name):
    gray = pattern(name, SHAPE)
    for parameters in (Parameters(), SENSITIVE):
        assert_sound(Detector(parameters).detect(gray), gray, parameters)


@pytest.mark.parametrize('shape', [(480, 640), (720, 1280)], ids=str)
def test_time_is_bounded(shape):
    detector, photograph = Detector(), np.tile(scene(), (9, 10))[:shape[0], :shape[1]]
    usual = min(seconds(detector, photograph) for _ in range(4))
    for name in PATTERNS:
        assert seconds(detector, pattern(name, shape)) < MOST_TIME * usual, name


@pytest.mark.parametrize('shape', [
    (1, 1), (1, 2), (2, 1), (1, 100_000), (100_000, 1), (3, 100_000), (100_000, 3)], ids=str)
def test_extreme_shapes(shape):
    for name in ('checkers of 3', 'lines across it all', 'noise of every grain'):
        gray = pattern(name, shape)
        assert_sound(Detector().detect(gray), gray)


@pytest.mark.parametrize('name', ['noise of two greys', 'zone plate'])
def test_memory_is_bounded_at_8k(name):
    # The most memory ever taken is known for whole processes alone.
    found = subprocess.run([sys.executable, __file__, name], capture_output=True, text=True,
                           check=True, timeout=120,
                           env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    assert float(found.stdout) < MOST_MEMORY


def memory(name: str, shape: tuple[int, int]) -> float:
    """Return the most memory that detection takes, in bytes for each pixel."""
    def peak() -> int:
        return 1024 * int(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0])

    Detector().warm_up()
    gray = pattern(name, shape)
    Path('/proc/self/clear_refs').write_text('5')       # the peak so far is forgotten
    before = peak()
    Detector().detect(gray)
    return (peak() - before) / gray.size


@given(st.integers(0, 10**6), st.integers(1, 60), st.integers(1, 60), st.integers(1, 8),
       st.integers(1, 8))
def test_blocks_are_sound(seed, rows, columns, height, width):
    """Random blocks of random greys: corners and T junctions only."""
    random = np.random.default_rng(seed)
    blocks = random.integers(0, 256, (rows, columns), np.uint8)
    gray = np.kron(blocks, np.ones((height, width), np.uint8))
    for parameters in (Parameters(), SENSITIVE):
        assert_sound(Detector(parameters).detect(gray), gray, parameters)


if __name__ == '__main__':
    print(memory(sys.argv[1], (4320, 7680)))
