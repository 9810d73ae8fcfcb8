"""
What PL-VIO, PL-VINS, EPLF-VINS and PLVINS_ROS2 do with ~/line_features, written anew in numpy.

Their estimators queue line and point messages, pair the oldest of both, decode the ids, append
observations to lines by id, and triangulate a line from two planes once it has five observations,
by the pose of the n-th frame after its first.
"""
from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
import numpy as np
import pytest
from qflsd_ros.core import Attitude, Tracker
from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.line_features.feed import Feed
from qflsd_ros.overlay import NO_TAILS
from qflsd_ros.ros.output import camera_info
from qflsd_ros.ros.output.topics import OUTPUTS, Result
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources import Scene, SceneFrames
from sensor_msgs.msg import PointCloud
from std_msgs.msg import Header

OUTPUT, = (output for output in OUTPUTS if output.topic == '~/line_features')
LEAST_OBSERVATIONS, PARALLEL = 5, 0.998     # theirs
SPEED = 3       # images of the scene's path between two of the camera
COUNT = 120     # images of the camera, 4 s at 30 Hz: 1.3 m


class Walk(NamedTuple):
    """Messages of a camera that moves in the room, and its poses by stamp."""

    scene: Scene
    results: list[Result]
    poses: dict[int, np.ndarray]


def walk(lam: float) -> Walk:
    scene, tracker = Scene(640, 480, lam), Tracker()
    camera = SceneFrames(scene).camera
    results, poses = [], {}
    for number in range(COUNT):
        stamp = 10**12 + number * 10**9 // 30
        header = Header(stamp=Time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id='eye')
        gray = scene.image(SPEED * number)
        results.append(Result(
            header, gray, tracker.track(gray), Settings(), None, NO_TAILS,
            camera_info.calibrated(header, camera, *gray.shape), '/camera_info'))
        poses[stamp] = scene.pose(SPEED * number)
    return Walk(scene, results, poses)


@pytest.fixture(scope='module')
def straight() -> Walk:
    """Give a walk through a lens without distortion, shared by the tests of this module."""
    return walk(0.0)


@pytest.fixture(scope='module')
def bent() -> Walk:
    """Give a walk through a wide-angle lens."""
    return walk(-0.5)


def messages(walk: Walk, feed: Feed | None = None, **changes: Any) -> list[PointCloud]:
    """Return the messages of a walk with some settings changed."""
    feed, settings = feed or Feed(), replace(Settings(), **changes)
    results = [replace(result, feed=feed, settings=settings) for result in walk.results]
    return [OUTPUT.message(result) for result in results if OUTPUT.passes(result)]


def stamp(message: PointCloud) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def decoded(message: PointCloud, cameras: int = 1) -> dict[int, tuple[int, np.ndarray]]:
    """Return camera and (x_start, y_start, x_end, y_end) by line, as those systems read them."""
    lines = {}
    for i, point in enumerate(message.points):
        value = int(message.channels[0].values[i] + 0.5)
        ends = (point.x, point.y, message.channels[1].values[i], message.channels[2].values[i])
        lines[value // cameras] = value % cameras, np.array(ends)
    return lines


class Line:
    """Observations of a line from its first frame on, one for each frame."""

    def __init__(self, first: int) -> None:
        self.first = first
        self.observations: list[np.ndarray] = []
        self.triangulated: np.ndarray | None = None
        self.least_cosine = 1.0


class Estimator:
    """The part of those systems that takes lines, with the true poses."""

    def __init__(self, poses: dict[int, np.ndarray]) -> None:
        self.points: deque[int] = deque()
        self.queue: deque[PointCloud] = deque()
        self.truth = poses
        self.frames: list[int] = []
        self.lines: dict[int, Line] = {}

    def work(self) -> None:
        while self.points and self.queue:
            point, message = self.points.popleft(), self.queue.popleft()
            assert point == stamp(message)  # they do not check it
            self.frames.append(point)
            for number, (_, ends) in decoded(message).items():
                line = self.lines.setdefault(number, Line(len(self.frames) - 1))
                line.observations.append(ends)
                # The n-th observation is taken for that of the n-th frame.
                assert line.first + len(line.observations) == len(self.frames)
                self._triangulate(line)

    def _triangulate(self, line: Line) -> None:
        if line.triangulated is not None or len(line.observations) < LEAST_OBSERVATIONS:
            return
        planes = [self._plane(line.first + k, ends) for k, ends in enumerate(line.observations)]
        cosines = [planes[0][:3] @ plane[:3] for plane in planes[1:]]
        line.least_cosine = min(cosines)
        if line.least_cosine < PARALLEL:
            other = planes[1 + int(np.argmin(cosines))]
            line.triangulated = self._ends(line, planes[0], other)

    def _plane(self, frame: int, ends: np.ndarray) -> np.ndarray:
        """Return the plane n x + d = 0 through the optical centre, in the world, |n| = 1."""
        pose = self.truth[self.frames[frame]]
        normal = pose[:3, :3] @ np.cross([*ends[:2], 1], [*ends[2:], 1])
        normal /= np.linalg.norm(normal)
        return np.array([*normal, -normal @ pose[:3, 3]])

    def _ends(self, line: Line, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Return the ends of the intersection of two planes as the first frame sees them."""
        pose = self.truth[self.frames[line.first]]
        x0, y0, x1, y1 = line.observations[0]
        across = np.cross([x0, y0, 1], [x1, y1, 1])[:2]
        ends = []
        for point in ((x0, y0), (x1, y1)):
            normal = pose[:3, :3] @ np.cross([*point, 1], [*(point + across), 1])
            planes = np.stack([one, other, [*normal, -normal @ pose[:3, 3]]])
            ends.append(np.linalg.solve(planes[:, :3], -planes[:, 3]))
        return np.array(ends)


def distances(walk: Walk, ends: np.ndarray, eye: np.ndarray) -> float:
    """Return how far a line is from the nearest true edge, at most, as a share of its depth."""
    edges = walk.scene._edge_ends
    along = edges[:, 1] - edges[:, 0]
    samples = ends[0] + np.linspace(0, 1, 9)[:, None] * (ends[1] - ends[0])
    offset = samples[:, None] - edges[:, 0]
    share = np.clip((offset * along).sum(2) / (along ** 2).sum(1), 0, 1)
    off = np.linalg.norm(offset - share[:, :, None] * along, axis=2)
    return float((off / np.linalg.norm(samples - eye, axis=1)[:, None]).max(axis=0).min())


@pytest.mark.slow
@pytest.mark.parametrize('lens', ['straight', 'bent'])
def test_estimators_triangulate_true_edges(request: pytest.FixtureRequest, lens: str) -> None:
    room = request.getfixturevalue(lens)
    estimator = Estimator(room.poses)
    for message in messages(room):
        estimator.points.append(stamp(message))     # a point tracker at the same rate
        estimator.queue.append(message)
        estimator.work()
    assert len(estimator.frames) == COUNT // 3 and not estimator.queue
    found = [line for line in estimator.lines.values() if line.triangulated is not None]
    # A line whose direction of travel turned would have a cosine of about -1.
    assert min(line.least_cosine for line in found) > 0.5
    off = np.array([distances(room, line.triangulated,
                              room.poses[estimator.frames[line.first]][:3, 3]) for line in found])
    # Some are of the grain of wood.
    assert len(found) > 40
    assert np.median(off) < 0.01 and (off < 0.03).mean() > 0.7


@pytest.mark.slow
def test_lines_stay_over_messages(bent: Walk) -> None:
    """Of the lines of a message, most have been in the one before."""
    seen = [set(decoded(message)) for message in messages(bent)]
    assert all(len(lines) == 70 for lines in seen[5:])
    shares = [len(before & after) / len(after) for before, after in zip(seen[5:], seen[6:])]
    assert np.mean(shares) > 0.93 and min(shares) > 0.8


@pytest.mark.slow
def test_messages_are_the_same_every_time(bent: Walk) -> None:
    one, other = messages(bent), messages(bent)
    assert one == other


@pytest.mark.slow
def test_layout(bent: Walk) -> None:
    for message in messages(bent, line_features_max=20, line_features_min_length=60.0)[:5]:
        assert type(message) is PointCloud and message.header.frame_id == 'eye'
        assert [channel.name for channel in message.channels] == [
            'id', 'x_end', 'y_end', 'std', 'direction', 'track']
        assert {len(channel.values) for channel in message.channels} == {len(message.points)}
        assert len(message.points) == 20 and {point.z for point in message.points} == {1.0}
        result = next(result for result in bent.results if result.header == message.header)
        table = result.arcs.table
        tracks = np.array(message.channels[5].values, int)
        rows = table[[int(np.flatnonzero(table['track'] == track)[0]) for track in tracks]]
        assert rows['length'].min() >= 60
        # In px, the start of the line is that of the arc.
        starts = np.array([(point.x, point.y, 1) for point in message.points])
        axes = bent.scene._camera(0).axes
        seen = replace(bent.scene._camera(0), position=np.zeros(3)).project(starts @ axes)
        assert np.abs(seen - rows['start']).max() < 0.5
        assert 0 < min(message.channels[3].values) and max(message.channels[3].values) < 0.01
        assert set(message.channels[4].values) == {-1.0}


@pytest.mark.slow
def test_directions_are_those_of_the_attitude(straight: Walk) -> None:
    result = straight.results[0]
    labels = np.arange(len(result.arcs)) % 4 - 1
    attitude = Attitude(
        360.0, 1.0, np.array([0.0, -1, 0]), 0.01, -np.eye(3)[[1, 0, 2]], labels, None, 0.0,
        np.eye(3))
    message = OUTPUT.message(replace(result, attitude=attitude, feed=Feed()))
    of_track = dict(zip(result.arcs.table['track'].tolist(), labels.tolist()))
    assert list(message.channels[4].values) == [
        of_track[int(track)] for track in message.channels[5].values]


@pytest.mark.slow
def test_an_image_without_arcs_gives_an_empty_message_in_the_same_layout(
        straight: Walk) -> None:
    result = straight.results[0]
    table = np.zeros(0, result.arcs.table.dtype)
    empty = replace(Arcs.empty(), table=table)
    message = OUTPUT.message(replace(result, arcs=empty, feed=Feed()))
    assert message.header == result.header and len(message.points) == 0
    assert [channel.name for channel in message.channels][:3] == ['id', 'x_end', 'y_end']
    assert all(len(channel.values) == 0 for channel in message.channels)


@pytest.mark.slow
def test_two_cameras_are_told_apart(straight: Walk) -> None:
    left, right = (messages(straight, cameras=2, camera_index=index)[3] for index in (0, 1))
    assert {camera for camera, _ in decoded(left, 2).values()} == {0}
    assert {camera for camera, _ in decoded(right, 2).values()} == {1}
    assert not set(decoded(left, 2)) & set(decoded(right, 2))
