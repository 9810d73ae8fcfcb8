"""Tracks of the node, over real DDS: each line keeps its identity, whatever happens."""
from __future__ import annotations

import itertools
from typing import Any, Iterator, TYPE_CHECKING

import cv2
import numpy as np
import pytest
from qflsd_ros.core import Tracker
from qflsd_ros.overlay import colours
from qflsd_ros.ros.output import clouds
from qflsd_ros.sources import Scene
from rig import BLACK, header, image, Rig, SCENE, values

if TYPE_CHECKING:
    from conftest import Peer

ROOM = Scene(480, 360, lam=-0.4)
numbers = itertools.count(400)
LONG = 60.0     # px; consumers use such lines


@pytest.fixture(scope='module')
def rig(module_peer: Peer) -> Iterator[Rig]:
    """Give one detector with tracks, shared by the tests of this module."""
    yield Rig(module_peer, listen=('segments', 'arcs', 'markers', 'overlay', 'rectified'),
              tracking=True).ready()


def walk(rig: Rig, count: int) -> list[np.ndarray]:
    """Show the next frames of a camera in the room; return the records of their arcs."""
    return [clouds.records(rig.detect(image(ROOM.image(next(numbers))), 'arcs'))
            for _ in range(count)]


def tracks(rows: np.ndarray, least: float = LONG) -> set[int]:
    return set(rows['track'][rows['length'] >= least].tolist())


def kept(before: np.ndarray, after: np.ndarray) -> float:
    """Return the share of the long tracks of a frame that a later one has."""
    return len(tracks(before) & tracks(after, 0.0)) / len(tracks(before))


def test_identities_stay_over_the_frames_of_a_camera(rig: Rig) -> None:
    seen = walk(rig, 12)
    assert min(len(tracks(rows)) for rows in seen) > 20
    assert kept(seen[2], seen[-1]) > 0.85
    for rows in seen:
        assert len(set(rows['track'].tolist())) == len(rows) and rows['track'].min() >= 1
        assert rows['age'].min() >= 1 and set(rows['held'].tolist()) <= {0, 1}
    assert np.median(seen[-1]['age']) >= 10


def test_every_topic_carries_the_same_tracks(rig: Rig) -> None:
    message = image(ROOM.image(next(numbers)))
    rows = clouds.records(rig.detect(message, 'arcs'))

    def first(output: str) -> Any:
        return rig.peer.until(lambda: next((answer for answer in rig.received[output]
                                            if header(answer) == message.header), None))
    points = clouds.records(first('segments'))
    assert len(points) and (points['track'] == rows['track'][points['segment']]).all()
    marker, = first('markers').markers
    shown = {tuple(round(255 * part) for part in (one.b, one.g, one.r)) for one in marker.colors}
    assert shown == set(map(tuple, colours(rows['track']).tolist()))


def test_parameters_that_change_in_between_keep_identities(rig: Rig) -> None:
    before, = walk(rig, 1)
    assert all(result.successful for result in rig.change(
        min_length=12.0, tolerance=0.8, line_width=2, lens='fixed', lens_lambda=-0.4))
    after, = walk(rig, 1)
    assert kept(before, after) > 0.9
    assert rig.change(tracking=False)[0].successful
    rows, = walk(rig, 1)
    assert len(rows) and not rows['track'].any() and not rows['age'].any()
    assert all(result.successful for result in rig.change(
        tracking=True, min_length=15.0, tolerance=0.7, line_width=1, lens='off'))
    again, = walk(rig, 1)
    assert kept(after, again) > 0.85


def test_a_loop_of_stamps_and_a_new_camera_keep_identities(rig: Rig) -> None:
    """Stamps that jump back end no track; the image decides."""
    before, = walk(rig, 1)
    message = image(ROOM.image(next(numbers)))
    message.header.stamp.sec = 3
    assert kept(before, clouds.records(rig.detect(message, 'arcs'))) > 0.9
    rig.peer.node.destroy_publisher(rig.camera)
    rig.camera = rig.peer.node.create_publisher(type(message), rig.topic, 1)
    rig.ready()
    after, = walk(rig, 1)
    assert kept(before, after) > 0.85


def test_a_jump_to_another_place_has_new_identities_alone(rig: Rig) -> None:
    """As at the end of a bag that is played in a loop."""
    before, = walk(rig, 1)
    other = cv2.resize(SCENE, (480, 360), interpolation=cv2.INTER_AREA)
    after = clouds.records(rig.detect(image(other), 'arcs'))
    assert len(after) >= 4 and not tracks(before, 0.0) & tracks(after, 0.0)


def test_frames_of_another_size_have_new_identities_and_do_no_harm(rig: Rig) -> None:
    before = clouds.records(rig.detect(image(ROOM.image(next(numbers))), 'arcs'))
    for size in ((1, 1), (90, 120), (240, 320)):
        gray = cv2.resize(SCENE, size[::-1], interpolation=cv2.INTER_AREA)
        after = clouds.records(rig.detect(image(gray), 'arcs'))
        assert not tracks(before, 0.0) & tracks(after, 0.0)
    assert len(after) >= 4
    first, second = walk(rig, 2)
    assert kept(first, second) > 0.9


def test_a_black_frame_has_no_tracks_and_ends_none(rig: Rig) -> None:
    before = walk(rig, 5)[-1]
    dark = np.zeros((360, 480), np.uint8)
    assert rig.detect(image(dark), 'arcs').width == 0
    after, = walk(rig, 1)
    assert kept(before, after) > 0.8


def test_tails_show_where_tracks_were(rig: Rig) -> None:
    """They end with the parameter."""
    def ink_beside_arcs(count: int) -> int:
        """Return the number of coloured pixels that are farther than 2 px from all arcs."""
        assert rig.change(trails=count)[0].successful
        walk(rig, 4)
        message = image(ROOM.image(next(numbers)))
        picture = rig.detect(message, 'overlay')
        pixels = np.frombuffer(picture.data, np.uint8).reshape(360, 480, 3).astype(int)
        lines = clouds.polylines(rig.detect(message, 'segments'))
        near = cv2.polylines(np.zeros((360, 480), np.uint8),
                             [np.rint(line).astype(np.int32) for line in lines], False, 255, 5)
        return int(((np.ptp(pixels, axis=2) > 0) & (near == 0)).sum())
    without, some, again = map(ink_beside_arcs, (0, 10, 0))
    assert max(without, again) < 20 and some > 100


def test_diagnostics_count_tracks(rig: Rig) -> None:
    rig.reports.clear()
    walk(rig, 3)
    found = values(rig.report('track age median (frames)'))
    assert int(found['tracks']) > 20 and float(found['track age median (frames)']) >= 1
    assert float(found['tracks new (1/s)']) >= 0 and float(found['tracks lost (1/s)']) >= 0
    rig.change(tracking=False)
    rig.detect(image(BLACK))
    rig.peer.until(lambda: rig.reports and 'tracks' not in values(rig.reports[-1]))
    rig.change(tracking=True)


def test_method_paper_has_no_tracks_and_says_so(peer: Peer) -> None:
    rig = Rig(peer, '-p', 'method:=paper', tracking=True).ready()
    rows = clouds.records(rig.detect(image(SCENE)))
    assert len(rows) and not rows['track'].any()
    assert 'method is paper: it has no tracks, so that parameter tracking has no effect' \
        in rig.process.output
    assert rig.change(method='arcs')[0].successful
    assert clouds.records(rig.detect(image(SCENE)))['track'].min() == 1


def test_a_reduced_image_is_tracked_in_its_own_pixels(peer: Peer) -> None:
    """Results are in px of the image, as those of a tracker on the reduced image."""
    rig = Rig(peer, '-p', 'max_width:=320', tracking=True, listen=('arcs',)).ready()
    scene, tracker = Scene(640, 480, lam=-0.4), Tracker()
    grays = [scene.image(400 + number) for number in range(3)]
    shown = {}
    for gray in grays:
        message = image(gray)
        shown[message.header.stamp.sec] = gray
        rig.detect(message, 'arcs')
    for answer in rig.received['arcs']:
        small = cv2.resize(shown[answer.header.stamp.sec], (320, 240),
                           interpolation=cv2.INTER_AREA)
        arcs, rows = tracker.track(small).scaled(2), clouds.records(answer)
        assert rows['track'].tolist() == arcs.table['track'].tolist()
        assert rows['length'] == pytest.approx(arcs.table['length'], rel=1e-5)
