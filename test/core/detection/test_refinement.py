"""Rounded corners bend no arc, and stated deviations are those of the errors."""
from __future__ import annotations

from finding import find
import numpy as np
import pytest
from qflsd_ros.core import Arcs, detector
from rendering import disk, polygon, Region, render

WIDE = 40.0         # px, of a bar
LENGTHS = (20.0, 60), (40.0, 60), (60.0, 60), (120.0, 60)     # px, and how many of them


def bar(middle: np.ndarray, turn: float, length: float, radius: float) -> Region:
    """Return a bar with one side of a length at its middle, straight or of a radius."""
    along = np.array([np.cos(turn), np.sin(turn)])
    across = np.array([-along[1], along[0]])
    corners = [middle - along * length / 2, middle + along * length / 2]
    if radius:      # whose arc then cuts this side off
        corners = [corner - 10 * across for corner in corners]
    corners += [corner + WIDE * across for corner in corners[::-1]]
    region = polygon([tuple(corner) for corner in corners])
    if not radius:
        return region
    rounded = disk(*(middle + radius * across), radius)
    return lambda u, v: np.minimum(region(u, v), rounded(u, v))


def middle_arc(arcs: Arcs, middle: np.ndarray) -> np.void | None:
    """Return the row of the arc whose middle is nearest, where that is near."""
    off = np.hypot(*(arcs.table['middle'] - middle).T)
    return arcs.table[off.argmin()] if off.min(initial=np.inf) < 6 else None


def errors(blur: float, length: float, noise: float, radius: float, count: int) -> np.ndarray:
    """Return errors of curvature and offset in stated deviations, (N, 2)."""
    found: list[tuple[float, float]] = []
    size = int(length + 2 * WIDE + 20)
    for seed in range(count):
        random = np.random.default_rng([seed, int(length), int(10 * noise)])
        turn = random.uniform(0, 2 * np.pi)
        middle = (size - 1) / 2 + random.uniform(-0.5, 0.5, 2)
        half = random.uniform(25, 90)
        gray = render((size, size), bar(middle, turn, length, radius), 128 - half, 128 + half,
                      blur, noise, int(random.integers(10 ** 9)))
        row = middle_arc(find(gray, min_length=10.0), middle)
        if row is None:
            continue
        across = np.array([-np.sin(turn), np.cos(turn)])
        if radius:
            off = radius - np.hypot(*(row['middle'] - middle - radius * across))
            found.append(((row['curvature'] - 1 / radius) / row['curvature_std'],
                          off / row['offset_std']))
        else:
            found.append((row['curvature'] / row['curvature_std'],
                          (row['middle'] - middle) @ across / row['offset_std']))
    return np.array(found)


@pytest.fixture(autouse=True)
def every_arc_is_bent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Report what was fitted, also where it does not differ from 0."""
    monkeypatch.setattr(detector, 'SIGNIFICANCE', 0.0)


@pytest.mark.slow
@pytest.mark.parametrize('noise', [1.0, 2.0, 5.0])
@pytest.mark.parametrize('blur', [0.0, 0.8, 1.5])
@pytest.mark.parametrize('radius', [0.0, 300.0])
def test_deviations_are_those_of_the_errors(radius, blur, noise):
    found = np.concatenate([errors(blur, length, noise, radius, count)
                            for length, count in LENGTHS])
    assert len(found) > 200
    rms = np.sqrt((found ** 2).mean(axis=0))
    assert 0.8 < rms[0] < 1.25 and 0.8 < rms[1] < 1.3


@pytest.mark.parametrize('blur, length, count', [(0.0, 400.0, 12), (0.8, 400.0, 12),
                                                 (1.5, 400.0, 12), (3.0, 40.0, 50),
                                                 (3.0, 120.0, 40)])
def test_deviations_of_long_and_of_blurred_edges(blur, length, count):
    found = errors(blur, length, 1.0, 0.0, count)
    assert 0.6 < np.sqrt((found[:, 0] ** 2).mean()) < 1.4


@pytest.mark.parametrize('blur', [0.8, 1.5, 3.0])
def test_rounded_corners_do_not_bend_an_edge(blur):
    found = errors(blur, 60.0, 1.0, 0.0, 40)
    assert abs(found[:, 0].mean()) < 0.5
