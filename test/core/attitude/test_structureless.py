"""Images without three orthogonal directions: no attitude, or up alone, with the reason."""
from __future__ import annotations

from collections.abc import Callable
import logging

import cv2
from manhattan import angle, SHAPE
import numpy as np
import pytest
from qflsd_ros.core import (
    Attitude, Detector, DivisionModel, estimate_attitude, estimate_distortion)

# Pictures are drawn twice as large, so that their edges are as smooth as those of a camera.
LARGE = (2 * SHAPE[0], 2 * SHAPE[1])


def seen(large: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the image of a drawing by a camera with noise: (480, 640) uint8."""
    small = cv2.resize(large, SHAPE[::-1], interpolation=cv2.INTER_AREA)
    return np.clip(small + random.normal(0, 3, SHAPE), 0, 255).astype(np.uint8)


def ellipse(picture: np.ndarray, centre: np.ndarray, axes: tuple[float, float], turn: float,
            shade: float, arc: float = 360.0, width: int = -1) -> None:
    x, y = np.rint(centre).astype(int).tolist()
    cv2.ellipse(picture, (x, y), (int(axes[0]), int(axes[1])), turn, 0, arc, int(shade), width,
                cv2.LINE_AA)


def curved_things(random: np.random.Generator) -> np.ndarray:
    picture = np.full(LARGE, 120, np.uint8)
    for _ in range(60):
        ellipse(picture, random.uniform(0, LARGE[::-1]), tuple(random.uniform(30, 260, 2)),
                random.uniform(0, 180), random.uniform(20, 235))
    return picture


def face(random: np.random.Generator) -> np.ndarray:
    """Return a head with hair, eyes, mouth, nose, ears and shoulders."""
    picture = np.full(LARGE, 90, np.uint8)
    centre, turn = np.array([640, 440]) + random.normal(0, 40, 2), random.normal(0, 10)
    for x, y, a, b, shade in (
            (0, 470, 420, 150, 60), (-280, 0, 40, 90, 170), (280, 0, 40, 90, 170),
            (0, 0, 270, 370, 190), (0, -250, 260, 150, 40), (-110, -60, 55, 28, 240),
            (110, -60, 55, 28, 240), (-110, -60, 26, 26, 40), (110, -60, 26, 26, 40),
            (-110, -120, 70, 20, 60), (110, -120, 70, 20, 60), (0, 170, 100, 35, 120),
            (0, 60, 45, 70, 175)):
        ellipse(picture, centre + [x, y], (a, b), turn, shade)
    for _ in range(60):
        size = random.uniform(20, 120)
        ellipse(picture, centre + random.normal(0, 1, 2) * [200, 60] - [0, 330],
                (size, 1.5 * size), random.uniform(0, 360), random.uniform(10, 70),
                random.uniform(20, 90), 2)
    return picture


def forest(random: np.random.Generator) -> np.ndarray:
    picture = np.full(LARGE, 200, np.uint8)
    for _ in range(14):
        foot = np.array([random.uniform(0, LARGE[1]), random.uniform(800, 960)])
        grow(picture, random, foot, random.normal(0, 0.12), random.uniform(150, 320),
             random.uniform(8, 34))
    return picture


def grow(picture: np.ndarray, random: np.random.Generator, foot: np.ndarray, lean: float,
         length: float, width: float) -> None:
    """Draw a bent branch and those that grow from its end; ``lean`` is radians from upright."""
    if length < 14:
        return
    way, bend = [foot], random.normal(0, 0.04)
    for _ in range(4):
        way.append(way[-1] + length / 4 * np.array([np.sin(lean), -np.cos(lean)]))
        lean += bend
    cv2.polylines(picture, [np.rint(np.array(way) * 16).astype(np.int32)], False,
                  int(random.uniform(20, 120)), max(1, int(width)), cv2.LINE_AA, 4)
    for _ in range(random.integers(2, 4)):
        grow(picture, random, way[-1], lean + random.normal(0, 0.5),
             length * random.uniform(0.6, 0.85), 0.65 * width)


def wall(random: np.random.Generator, lam: float, roll: float) -> np.ndarray:
    """Return bricks seen frontally through a lens, by a camera that is rolled, radians."""
    lens = DivisionModel(lam, SHAPE)
    y, x = np.indices(LARGE)
    points = lens.undistort((np.stack([x, y], axis=-1) / 2 - 0.25).reshape(-1, 2)) - lens.origin
    c, s = np.cos(roll), np.sin(roll)
    x, y = (points @ np.array([[c, -s], [s, c]])).T
    row = np.floor(y / 40).astype(int)
    x = x + row % 2 * 45
    shade = random.integers(60, 200, (200, 200))[row % 200, np.floor(x / 90).astype(int) % 200]
    joint = (x % 90 < 5) | (y % 40 < 5)
    return np.where(joint, 220, shade).astype(np.uint8).reshape(LARGE)


def attitude(drawing: np.ndarray, random: np.random.Generator) -> Attitude | None:
    arcs = Detector().detect(seen(drawing, random))
    assert len(arcs) > 30
    return estimate_attitude(arcs, SHAPE, estimate_distortion([arcs], SHAPE))


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('draw', [curved_things, face, forest])
def test_nothing_is_known_where_no_edges_are_orthogonal(
        draw: Callable[[np.random.Generator], np.ndarray], seed: int,
        caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    random = np.random.default_rng(seed)
    assert attitude(draw(random), random) is None
    assert 'attitude not observable: axes gain' in caplog.text


@pytest.mark.parametrize('roll', [0.0, 0.1])
@pytest.mark.parametrize('lam', [0.0, -0.3, -0.6])
def test_a_wall_seen_frontally_has_up_alone(lam: float, roll: float) -> None:
    random = np.random.default_rng(0)
    found = attitude(wall(random, lam, roll), random)
    assert found is not None and found.focal is None and found.up is not None
    assert angle(found.up, np.array([np.sin(roll), -np.cos(roll), 0.0])) < 0.3
    assert 'focal length has a relative deviation of' in found.reasons[0]
