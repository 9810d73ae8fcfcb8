"""The image circle: found where there is one, not where there is none, and without a trace."""
from __future__ import annotations

import cv2
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from qflsd_ros.core import Arcs, Detector, Parameters, Tracker
from qflsd_ros.core.detection.image_circle import find_image_circle, ImageCircle
from qflsd_ros.core.detection.region import MARGIN, region
from scenery import noise as texture
from scenery import scene

SHAPE = (180, 240)
Y, X = np.mgrid[:SHAPE[0], :SHAPE[1]]
RADIUS = 86.0
APART = 12.0        # px from the rim, from where on no arc meets it
OFF = Parameters(image_circle='off')


def find(gray: np.ndarray, mask: np.ndarray | None = None) -> ImageCircle | None:
    return find_image_circle(gray, region(gray.shape, mask))


def fisheye(inside: np.ndarray, x: float, y: float, radius: float, outside: float = 0.0,
            blur: float = 0.7, noise: float = 0.0) -> np.ndarray:
    """Return an image within a circle, and a grey level outside of it, with noise all over."""
    rows, columns = np.mgrid[:inside.shape[0], :inside.shape[1]]
    share = np.clip(radius - np.hypot(columns - x, rows - y) + 0.5, 0, 1)
    share = cv2.GaussianBlur(share, (0, 0), blur)
    gray = outside + share * (inside.astype(float) - outside)
    gray += np.random.default_rng(1).normal(0, 1, inside.shape) * noise
    return np.clip(np.rint(gray), 0, 255).astype(np.uint8)


def room(seed: int = 0) -> np.ndarray:
    """Return a scene that is nowhere as dark as the outside, (180, 240) uint8."""
    return np.uint8(60 + 0.75 * scene(seed))


def place(row: np.void) -> tuple[float, ...]:
    """Return the end points and the middle of an arc."""
    return (*row['start'].tolist(), *row['middle'].tolist(), *row['end'].tolist())


def reach(arcs: Arcs, x: float, y: float) -> float:
    """Return the largest distance of the arcs from a point, px."""
    return max(float(np.hypot(*(line - (x, y)).T).max()) for line in arcs.polylines(0.1))


@given(st.floats(-12, 12), st.floats(-12, 12), st.floats(75, 118), st.floats(0, 4),
       st.floats(0.5, 2), st.integers(0, 3))
def test_circles_of_any_place_and_size_are_found(x, y, radius, noise, blur, seed):
    gray = fisheye(room(seed), 119.5 + x, 89.5 + y, radius, 8.0, blur, noise)
    circle = find(gray)
    assert circle is not None
    assert np.hypot(circle.x - 119.5 - x, circle.y - 89.5 - y) < 1.5
    assert abs(circle.radius - radius) < 1.5


@pytest.mark.parametrize('outside', [0.0, 26.0, 128.0, 255.0])
def test_the_outside_has_any_grey_level(outside):
    inside = np.where(abs(room().astype(float) - outside) < 30, (outside + 90) % 256, room())
    circle = find(fisheye(inside, 118, 91, RADIUS, outside))
    assert circle is not None and abs(circle.radius - RADIUS) < 1


def dark_corner(gray: np.ndarray) -> np.ndarray:
    cv2.putText(gray, '0.0 fps', (1, 10), cv2.FONT_HERSHEY_PLAIN, 0.8, 255)
    return gray


def dark_object(gray: np.ndarray) -> np.ndarray:
    cv2.rectangle(gray, (60, 120), (180, 179), 0, cv2.FILLED)
    return gray


def stray_light(gray: np.ndarray) -> np.ndarray:
    cv2.circle(gray, (205, 25), 9, 90, cv2.FILLED)
    return gray


@pytest.mark.parametrize('change', [dark_corner, dark_object, stray_light])
def test_what_covers_a_part_of_the_rim(change):
    circle = find(change(fisheye(room(), 120, 90, RADIUS)))
    assert circle is not None
    assert np.hypot(circle.x - 120, circle.y - 90) < 1.5 and abs(circle.radius - RADIUS) < 1.5


def vignetting() -> np.ndarray:
    fall = np.clip(1 - (np.hypot(X - 119.5, Y - 89.5) / 150) ** 2, 0, 1)
    return np.uint8(room() * fall)


def letterbox() -> np.ndarray:
    gray = room()
    gray[:30], gray[-30:] = 0, 0
    return gray


def framed() -> np.ndarray:
    gray = letterbox()
    gray[:, :30], gray[:, -30:] = 0, 0
    return gray


def night() -> np.ndarray:
    gray = np.random.default_rng(3).normal(6, 2, SHAPE).clip(0, 255).astype(np.uint8)
    for x, y, size in ((60, 50, 5), (130, 90, 12), (180, 70, 3), (90, 130, 7), (170, 140, 9)):
        cv2.circle(gray, (x, y), size, 220, cv2.FILLED)
    return gray


def disc(x: float, y: float, radius: float) -> np.ndarray:
    return fisheye(np.full(SHAPE, 200), x, y, radius)


def oval() -> np.ndarray:
    return cv2.ellipse(np.zeros(SHAPE, np.uint8), (120, 90), (110, 82), 0, 0, 360, 200, cv2.FILLED)


def hexagon() -> np.ndarray:
    angles = np.arange(6) * np.pi / 3
    corners = np.rint(np.column_stack([120 + 85 * np.cos(angles), 90 + 85 * np.sin(angles)]))
    return cv2.fillPoly(np.zeros(SHAPE, np.uint8), [corners.astype(np.int32)], 200)


NONE = {
    'black': np.zeros(SHAPE, np.uint8), 'white': np.full(SHAPE, 255, np.uint8),
    'vignetting': vignetting(), 'letterbox': letterbox(), 'frame': framed(), 'night': night(),
    'small disc': disc(120, 90, 50), 'disc at the side': disc(80, 90, 80), 'oval': oval(),
    'hexagon': hexagon(), 'two circles': np.hstack([disc(120, 90, 85)] * 2),
    'tiny': np.zeros((20, 300), np.uint8), 'noise': texture(5, SHAPE)}


@pytest.mark.parametrize('name', NONE)
def test_images_without_a_circle(name):
    gray = NONE[name]
    assert find(gray) is None
    assert Detector().detect(gray).table.tobytes() == Detector(OFF).detect(gray).table.tobytes()


@given(st.integers(0, 999))
def test_scenes_without_a_circle(seed):
    assert find(scene(seed)) is None


def test_an_object_that_looks_the_same_is_taken_for_a_circle():
    """The stated limit: a large disc before a uniform background, about the centre."""
    assert find(disc(120, 90, 80)) is not None


@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize(('x', 'y', 'radius'), [(120, 90, RADIUS), (126, 86, 100), (119, 92, 116)])
def test_no_arc_at_the_rim_and_all_others_as_without(seed, x, y, radius):
    gray = fisheye(room(seed), x, y, radius, 10.0, noise=1)
    detector = Detector()
    found, without = detector.detect(gray), Detector(OFF).detect(gray)
    assert detector.circle is not None and len(found) > 3
    clear = detector.circle.clear
    assert reach(found, clear.x, clear.y) <= clear.radius + 0.5
    assert radius - clear.radius < 9
    inner = [place(row) for row, line in zip(without.table, without.polylines(0.1))
             if np.hypot(*(line - (clear.x, clear.y)).T).max() < clear.radius - APART]
    assert inner and set(inner) <= {place(row) for row in found.table}


def test_the_rim_would_be_found_without():
    without = Detector(OFF).detect(fisheye(room(), 120, 90, RADIUS))
    on_rim = [line for line in without.polylines(0.1)
              if (abs(np.hypot(*(line - (120, 90)).T) - RADIUS) < 1.5).all()]
    assert sum(float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in on_rim) > RADIUS


def test_every_image_is_judged_by_itself():
    gray, other = fisheye(room(), 120, 90, RADIUS), room(2)
    detector = Detector()
    expected = [Detector().detect(image).table.tobytes() for image in (gray, other)]
    for i in (0, 1, 0, 0, 1):
        assert detector.detect((gray, other)[i]).table.tobytes() == expected[i]
        assert (detector.circle is None) == (i == 1)
    detector.parameters = OFF
    assert len(detector.detect(gray)) > 0 and detector.circle is None


def test_a_mask_combines_with_the_circle():
    gray, mask = fisheye(room(), 120, 90, RADIUS), Y < 120
    detector = Detector()
    arcs = detector.detect(gray, mask)
    assert detector.circle is not None and abs(detector.circle.radius - RADIUS) < 1.5
    clear = detector.circle.clear
    assert reach(arcs, clear.x, clear.y) <= clear.radius + 0.5
    assert all(line[:, 1].max() < 120 for line in arcs.polylines(0.1))


def test_masked_pixels_show_no_circle():
    """What is masked has no influence: also not as the outside of a circle."""
    gray = room(1)
    hidden = np.hypot(X - 120, Y - 90) >= RADIUS
    black = np.where(hidden, 0, gray).astype(np.uint8)
    assert find(black) is not None
    assert find(black, ~hidden) is None


def test_pixels_near_the_rim_are_not_seen():
    gray = fisheye(room(), 120, 90, RADIUS)
    detector = Detector()
    detector.detect(gray)
    assert detector.circle is not None and detector.frame is not None
    clear, where = detector.circle.clear, detector.frame.region
    inside = np.hypot(X - clear.x, Y - clear.y) <= clear.radius
    side = 2 * MARGIN + 1
    assert (where.allowed == inside).all()
    assert (where.seen == (cv2.erode(np.uint8(inside), np.ones((side, side))) > 0)).all()
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    assert (where.top, where.bottom, where.left, where.right) == (
        rows[0], rows[-1] + 1, columns[0], columns[-1] + 1)


def test_a_turned_image_has_the_turned_circle():
    gray = fisheye(room(), 123.3, 88.1, RADIUS, noise=1)
    circle, turned, mirrored = find(gray), find(gray.T.copy()), find(gray[:, ::-1].copy())
    assert circle is not None and turned is not None and mirrored is not None
    assert abs(turned.x - circle.y) < 0.3 and abs(turned.y - circle.x) < 0.3
    assert abs(mirrored.x - (239 - circle.x)) < 0.3 and abs(mirrored.radius - circle.radius) < 0.3


def test_tracks_stay_inside_between_searches_too():
    gray = fisheye(room(), 120, 90, RADIUS)
    tracker = Tracker(Parameters(detect_every=3))
    for _ in range(7):
        arcs = tracker.track(gray)
        assert tracker.circle is not None
        clear = tracker.circle.clear
        assert len(arcs) and reach(arcs, clear.x, clear.y) <= clear.radius + 0.5
