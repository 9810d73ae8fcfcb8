"""Identities of lines over frames."""
from pathlib import Path
import subprocess
import sys

import cv2
import numpy as np
import pytest
from qflsd_ros.core import DivisionModel, Parameters, Tracker, with_straightness
from qflsd_ros.core.arcs import TRACKED_TABLE
from qflsd_ros.core.kernels.kernel import Kernel
from qflsd_ros.core.tracking import state
from qflsd_ros.core.tracking.birth import LAST_IDENTITY

HEIGHT, WIDTH = 240, 320


def scene(seed: int = 1) -> np.ndarray:
    """Return a large image with rectangles of many grey levels."""
    random = np.random.default_rng(seed)
    image = np.full((2 * HEIGHT, 2 * WIDTH), 120, np.uint8)
    for _ in range(60):
        x, y = random.integers(0, 2 * WIDTH), random.integers(0, 2 * HEIGHT)
        box = ((float(x), float(y)), tuple(random.uniform(30, 120, 2)), random.uniform(0, 90))
        corners = np.rint(cv2.boxPoints(box)).astype(np.int32)
        cv2.fillPoly(image, [corners], int(random.integers(0, 255)), cv2.LINE_AA)
    return cv2.GaussianBlur(image, (0, 0), 0.7)


def frames(count: int, seed: int = 1, step: float = 4.0) -> list[np.ndarray]:
    """Return the frames of a camera that moves over the scene."""
    image = scene(seed)
    random = np.random.default_rng(seed)
    result = []
    for i in range(count):
        shift = np.float32([[1, 0, -100 - step * i], [0, 1, -80 - step / 2 * i]])
        view = cv2.warpAffine(image, shift, (WIDTH, HEIGHT))
        result.append(np.clip(view + random.normal(0, 2, view.shape), 0, 255).astype(np.uint8))
    return result


def identities(arcs) -> set[int]:
    """Return the identities of a frame."""
    return set(arcs.table['track'].tolist())


@pytest.mark.slow
def test_lines_keep_their_identity_their_place_and_their_direction():
    tracker, step = Tracker(), 4.0
    seen = [tracker.track(frame) for frame in frames(12, step=step)]
    first, last = seen[1], seen[11]
    common = identities(first) & identities(last)
    assert len(common) >= 0.6 * len(first) and len(first) > 20
    move = np.array([-step, -step / 2]) * 10
    apart, turned = [], []
    for track in common:
        a = first.table[first.table['track'] == track][0]
        b = last.table[last.table['track'] == track][0]
        u, v = a['end'] - a['start'], b['end'] - b['start']
        normal = np.array([-u[1], u[0]]) / np.hypot(*u)
        apart.append(abs((b['middle'] - a['middle'] - move) @ normal))
        turned.append(u @ v / np.hypot(*u) / np.hypot(*v))
    assert np.mean(np.array(apart) < 1.5) > 0.95
    assert min(turned) > 0.8


def grille(shift: float) -> np.ndarray:
    """Return a view of slanted bars half a period of 4.8 px wide, moved along x."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    across = (x - 0.05 * y - shift) / 4.8
    image = 110 + 90 * np.sin(2 * np.pi * across)
    image[:, :100] = image[:, 200:] = 60
    return image


def test_no_bar_of_a_grille_is_followed_twice():
    tracker, random = Tracker(), np.random.default_rng(1)
    for i in range(20):
        view = grille(0.5 * i) + random.normal(0, 2, (HEIGHT, WIDTH))
        found = tracker.track(np.clip(view, 0, 255).astype(np.uint8)).table
        long = found[found['length'] > 150]
        at = long['middle'] @ np.array([1, -0.05])     # the same all along a bar
        down = long['end'][:, 1] > long['start'][:, 1]
        for side in (at[down], at[~down]):
            assert len(side) > 15 and np.diff(np.sort(side)).min() > 3.5


def test_identities_are_unique_in_a_frame_and_begin_at_1():
    tracker = Tracker()
    for frame in frames(10):
        tracks = tracker.track(frame).table['track']
        assert len(set(tracks.tolist())) == len(tracks) and tracks.min() >= 1


def test_age_counts_the_frames_in_which_a_track_was_reported():
    tracker, count = Tracker(), {}
    for frame in frames(8):
        for row in tracker.track(frame).table:
            count[row['track']] = count.get(row['track'], 0) + 1
            assert row['age'] == count[row['track']]


def test_a_frame_without_arcs_has_an_empty_table_of_tracks():
    tracker = Tracker()
    for gray in (np.zeros((HEIGHT, WIDTH), np.uint8), np.full((HEIGHT, WIDTH), 90, np.uint8),
                 np.zeros((2, 2), np.uint8)):
        arcs = tracker.track(gray)
        assert len(arcs) == 0 and arcs.table.dtype == TRACKED_TABLE


@pytest.mark.parametrize('blank', ['black', 'blurred'])
def test_a_blackout_is_survived_and_nothing_is_reported_in_it(blank):
    tracker, images = Tracker(), frames(14)
    before = [tracker.track(frame) for frame in images[:7]][-1]
    for frame in images[7:10]:
        dark = np.zeros_like(frame) if blank == 'black' else cv2.GaussianBlur(frame, (0, 0), 14)
        arcs = tracker.track(dark)
        assert arcs.table['length'].sum() <= 0.05 * before.table['length'].sum()
    after = [tracker.track(frame) for frame in images[10:]][0]
    assert len(identities(before) & identities(after)) >= 0.6 * len(before)


def test_another_scene_has_new_identities_alone():
    tracker = Tracker()
    old = set().union(*(identities(tracker.track(frame)) for frame in frames(6, seed=1)))
    for frame in frames(6, seed=7):
        arcs = tracker.track(frame)
        assert len(arcs) > 10 and not identities(arcs) & old


def test_a_camera_that_stops_keeps_its_tracks():
    tracker, images = Tracker(), frames(6, step=14.0)
    moving = [tracker.track(frame) for frame in images][-1]
    for _ in range(3):
        still = tracker.track(images[-1])
        assert len(identities(moving) & identities(still)) >= 0.85 * len(moving)


def test_frames_of_another_size_start_anew_but_numbers_go_on():
    tracker, images = Tracker(), frames(3)
    old = set().union(*(identities(tracker.track(frame)) for frame in images))
    new = identities(tracker.track(images[-1][:200, :300]))
    assert new and min(new) > max(old)


def test_frames_between_searches_hold_the_lines_that_are_known():
    tracker = Tracker(Parameters(detect_every=4))
    seen = [tracker.track(frame) for frame in frames(12)]
    for i, arcs in enumerate(seen):
        assert arcs.table['held'].all() == (i % 4 != 0)
        if i % 4:
            assert identities(arcs) <= identities(seen[i - 1]) and len(arcs) > 20
    assert not identities(seen[4]) <= identities(seen[3])   # lines that came into sight
    assert len(identities(seen[1]) & identities(seen[11])) >= 0.6 * len(seen[1])


@pytest.mark.parametrize('after', range(4))
def test_another_scene_is_searched_at_once_whenever_it_comes(after):
    tracker = Tracker(Parameters(detect_every=4))
    old = [tracker.track(frame) for frame in frames(5 + after)]
    new = tracker.track(frames(1, seed=2)[0])
    assert len(new) > 20 and not identities(new) & set().union(*map(identities, old))


def test_between_searches_the_mask_and_the_size_count():
    tracker = Tracker(Parameters(detect_every=10))
    view = frames(1)[0]
    tracker.track(view)
    mask = np.full(view.shape, 255, np.uint8)
    mask[:, :WIDTH // 2] = 0
    held = tracker.track(view, mask)
    assert held.table['held'].all() and len(held) > 5
    assert (np.stack([held.table['start'], held.table['end']])[..., 0] > WIDTH / 2 - 0.5).all()
    assert not tracker.track(view[:200, :300]).table['held'].any()
    with pytest.raises(ValueError, match='mask has shape'):
        tracker.track(view[:200, :300], mask)
    assert len(tracker.track(view[:200, :300])) > 5


def test_the_same_frames_give_the_same_tracks_bit_for_bit():
    one, two = Tracker(), Tracker()
    for frame in frames(6):
        a, b = one.track(frame), two.track(frame)
        assert a.table.tobytes() == b.table.tobytes()
        assert a.edge_points.tobytes() == b.edge_points.tobytes()


def test_no_track_lies_on_a_masked_pixel():
    mask = np.ones((HEIGHT, WIDTH), np.uint8)
    mask[:, 150:200] = 0
    tracker = Tracker()
    for frame in frames(8):
        arcs = tracker.track(frame, mask=mask)
        points = np.concatenate(arcs.polylines(0.1))
        x = arcs.samples(50)[..., 0]
        assert len(points) and not ((x > 150) & (x < 199)).any()


def test_a_lens_is_taken():
    lens, tracker = DivisionModel(-0.1, (HEIGHT, WIDTH)), Tracker()
    seen = [tracker.track(frame, lens=lens) for frame in frames(4)]
    assert len(identities(seen[1]) & identities(seen[3])) >= 0.6 * len(seen[1])


def test_method_paper_is_refused():
    with pytest.raises(ValueError, match='method is paper'):
        Tracker(Parameters(method='paper')).track(np.zeros((HEIGHT, WIDTH), np.uint8))


def test_the_state_does_not_grow():
    tracker, images = Tracker(), frames(10)
    counts = []
    for k in range(12):
        for frame in images if k % 2 else images[::-1]:
            tracker.track(frame)
        counts.append(tracker._tracks.count)
    assert max(counts[6:]) <= 1.2 * max(counts[3:6]) and max(counts) < state.MOST


def test_numbers_begin_again_after_the_last_one_but_for_those_alive():
    tracker, images = Tracker(), frames(8)
    tracker.track(images[0])
    first = set(tracker._tracks.rows[:, state.IDENTITY].astype(int).tolist())
    assert {1, 2, 3} <= first
    tracker._next, given = LAST_IDENTITY, set()
    for image in images[1:]:
        tracker.track(image)
        alive = tracker._tracks.rows[:, state.IDENTITY].astype(int).tolist()
        assert len(set(alive)) == len(alive) and 1 <= min(alive) <= max(alive) <= LAST_IDENTITY
        given |= set(alive) - first
    assert LAST_IDENTITY in given and min(given) > 3 and len(given) > 3


def test_straightness_keeps_the_columns_of_a_track():
    tracker = Tracker()
    for frame in frames(3):
        arcs = tracker.track(frame)
    both = with_straightness(arcs, DivisionModel(-0.1, (HEIGHT, WIDTH))).table
    for name in ('track', 'age', 'held', 'length'):
        assert np.array_equal(both[name], arcs.table[name])
    assert np.isfinite(both['straight']).any()


def signatures() -> int:
    """Return how many signatures of kernels of the core this process has compiled or loaded."""
    return sum(kernel.versions for name, module in list(sys.modules.items())
               if name.startswith('qflsd_ros.core')
               for kernel in vars(module).values()
               if isinstance(kernel, Kernel) and kernel.py_func.__module__ == name)


def test_warm_up_leaves_no_kernel_to_compile():
    """Else the first frames of a camera would be late by seconds."""
    start = """
import numpy as np
from qflsd_ros.core import DivisionModel, Tracker, with_straightness
from qflsd_ros.core.lens import estimation
from qflsd_ros.core.lens.tracker import LensTracker
from test_tracker import frames, signatures
Tracker().warm_up()
estimation.warm_up()
before, tracker, lens = signatures(), Tracker(), LensTracker()
model, mask = DivisionModel(-0.2, frames(1)[0].shape), np.ones(frames(1)[0].shape, bool)
mask[:, :40] = False
for number, frame in enumerate([*frames(8), 0 * frames(1)[0]]):
    frame.flags.writeable = number < 4      # that of a message or a bag cannot be written
    arcs = tracker.track(frame, mask if number % 2 else None, model if number > 3 else None)
    with_straightness(arcs, model)
    lens.add(arcs, frame.shape)
print(before, signatures())
"""
    said = subprocess.run([sys.executable, '-c', start], cwd=Path(__file__).parent, check=True,
                          capture_output=True, text=True).stdout
    before, after = map(int, said.split())
    assert 20 < before == after


def test_min_length_holds_for_tracks_that_are_followed_already():
    tracker, images = Tracker(), frames(12)
    for image in images[:6]:
        arcs = tracker.track(image)
    assert (arcs.table['length'] < 40).any()
    tracker.parameters = Parameters(min_length=40)
    for image in images[6:]:
        after = tracker.track(image)
        assert len(after) > 5 and (after.table['length'] >= 40).all()
    assert identities(after) & identities(arcs)


def test_age_is_the_number_of_frames_with_the_track():
    tracker, times = Tracker(), {}
    for image in frames(15):
        for track, age in tracker.track(image).table[['track', 'age']].tolist():
            times[track] = times.get(track, 0) + 1
            assert age == times[track]
    assert max(times.values()) >= 10
