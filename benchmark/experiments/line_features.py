"""
Lines that PL-VINS can use: those of ~/line_features, and those of its own front end.

PL-VINS finds lines by LSD in the undistorted, equalised image, follows them from message to
message by LBD descriptors, and fills up to 35 lines near the horizontal and 35 others.  LSD with
optical flow instead of LBD stands beside it.
"""
from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from benchmark.experiment import Experiment
from benchmark.parallel import each
from benchmark.report import number, section, table
import cv2
import numpy as np
from qflsd_ros.core import Tracker
from qflsd_ros.core.geometry.planes import planes
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.line_features.feed import Feed, Limits
from qflsd_ros.core.line_features.pace import Pace
from qflsd_ros.core.line_features.undistorted import undistorted
from qflsd_ros.sources import Frame, open_source, Scene, SceneFrames, Source
from qflsd_ros.sources.sequence import DESCRIPTION

RATE = 10.0             # Hz, PL-VINS's freq
OBSERVATIONS = 5        # PL-VINS's LINE_MIN_OBS
MOST = 70               # lines; PL-VINS: 35 of each orientation
LENGTHS = 60.0, 30.0    # px; PL-VINS's own, and half of it
NEAR = 2.0              # px between a line in space and its observations, root mean square
ROOM = 'rendered room'
SPEED = 3               # images of the room's path between two of its camera
PERIOD = 10**9 // 30    # ns between images of the room
# LSD and LBD as PL-VINS sets them (linefeature_tracker.cpp).
CLAHE = 3.0, (8, 8)
LSD = {'scale': 0.5, 'sigma_scale': 0.6, 'quant': 2.0, 'ang_th': 22.5, 'log_eps': 1.0,
       'density_th': 0.6, 'n_bins': 1024}
HAMMING, MOVED, TURNED = 30, 200.0, 0.1     # bits, px, radians
# Optical flow along lines: points of a line, their reach in px, share of them that must arrive.
POINTS, REACH, ARRIVED = 16, 2.0, 0.5

# The stubs of OpenCV know neither module nor defaults.
descriptors: Any = getattr(cv2, 'line_descriptor', None)
optical_flow: Any = cv2.calcOpticalFlowPyrLK
make_lsd: Any = cv2.createLineSegmentDetector

Message = dict[int, np.ndarray]     # (2, 2) normalised ends by the number of the line


class Front(NamedTuple):
    """A front end: takes each frame and whether it is due, and returns the lines of due ones."""

    title: str
    make: Callable[[CameraModel, float], Callable[[np.ndarray, bool], Message]]


class Task(NamedTuple):
    """One front end on one sequence."""

    front: int
    sequence: str
    frames: int
    shortest: float     # px


class Figures(NamedTuple):
    """Lines a frame; usable ones; the share of these that are one line in space."""

    lines: float
    usable: float
    in_space: float


def ours(camera: CameraModel, shortest: float) -> Callable[[np.ndarray, bool], Message]:
    """Return what the node does, which follows lines through all images."""
    tracker, feed = Tracker(), Feed()

    def take(gray: np.ndarray, due: bool) -> Message:
        arcs = tracker.track(gray)
        if not due:
            return {}
        lines, ids = feed.take(undistorted(arcs, planes(arcs, camera), camera), arcs, gray.shape,
                               Limits(MOST, shortest))
        return dict(zip(ids.tolist(), np.stack([lines.starts, lines.ends], axis=1)))
    return take


class Chain:
    """LSD in undistorted images with identities from message to message, as PL-VINS has them."""

    def __init__(self, camera: CameraModel, shortest: float) -> None:
        if camera.model == 'equidistant':
            raise ValueError('equidistant: must be a pinhole camera, which PL-VINS needs')
        self._camera, self._shortest, self._next = camera, shortest, 0
        self._last: tuple[Any, ...] | None = None

    def __call__(self, gray: np.ndarray, due: bool) -> Message:
        """Return the lines of an image that is due; the others are not looked at."""
        if not due:
            return {}
        plain = cv2.createCLAHE(*CLAHE).apply(
            cv2.undistort(gray, self._camera.matrix, self._camera.coefficients[:8]))
        lines, looks = self._find(plain)
        ids = np.full(len(lines), -1)
        if self._last is not None and len(lines) and len(self._last[1]):
            for before, after in self._follow(plain, lines, looks):
                ids[after] = self._last[2][before]
        kept = self._filled(lines, ids)
        fresh = ids[kept] < 0
        ids[kept[fresh]] = self._next + np.arange(fresh.sum())
        self._next += int(fresh.sum())
        self._last = plain, lines[kept], ids[kept], None if looks is None else looks[kept]
        inverse = np.linalg.inv(self._camera.matrix)
        ends = (np.concatenate([lines, np.ones((len(lines), 2, 1))], axis=2) @ inverse.T)[..., :2]
        return dict(zip(ids[kept].tolist(), ends[kept]))

    def _filled(self, lines: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """Return the lines that are kept: those that go on, and new ones of each orientation."""
        along = np.abs(lines[:, 1] - lines[:, 0])
        upright, old = along[:, 1] > along[:, 0], ids >= 0
        kept = [np.flatnonzero(old)]
        for part in (upright, ~upright):
            kept.append(np.flatnonzero(part & ~old)[:max(MOST // 2 - int((part & old).sum()), 0)])
        return np.concatenate(kept)

    def _find(self, plain: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        detector = make_lsd(1, *LSD.values())
        found = detector.detect(plain)[0]
        lines = np.zeros((0, 2, 2)) if found is None else found.reshape(-1, 2, 2).astype(float)
        return lines[np.hypot(*(lines[:, 1] - lines[:, 0]).T) >= self._shortest], None

    def _follow(self, plain: np.ndarray, lines: np.ndarray, _: Any) -> list[tuple[int, int]]:
        """Return pairs of lines before and now: most points of the one arrive at the other."""
        assert self._last is not None
        image, before, *_ = self._last
        shares = np.linspace(0, 1, POINTS)[:, None]
        points = before[:, None, 0] + shares * (before[:, 1] - before[:, 0])[:, None]
        moved, ok, _ = optical_flow(
            image, plain, points.reshape(-1, 1, 2).astype(np.float32), None, winSize=(15, 15),
            maxLevel=3)
        distance = _distances(moved[:, 0].astype(float), lines)
        nearest = distance.argmin(axis=1)
        hit = (ok.ravel() == 1) & (distance.min(axis=1) < REACH)
        votes = np.zeros((len(before), len(lines)), int)
        np.add.at(votes, (np.repeat(np.arange(len(before)), POINTS)[hit], nearest[hit]), 1)
        pairs: dict[int, int] = {}
        for i, j in zip(*np.unravel_index(np.argsort(-votes, axis=None, kind='stable'),
                                          votes.shape)):
            if votes[i, j] < ARRIVED * POINTS:
                break
            if i not in pairs and j not in pairs.values():
                pairs[int(i)] = int(j)
        return list(pairs.items())


class Described(Chain):
    """The same with LBD descriptors: PL-VINS's own matching."""

    def _find(self, plain: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        module, values = descriptors, descriptors.LSDParam()
        for name, value in LSD.items():
            setattr(values, name, value)
        found = module.LSDDetector_createLSDDetectorWithParams(values).detect(plain, 2, 1)
        found = [line for line in found if line.lineLength >= self._shortest]
        if not found:
            return np.zeros((0, 2, 2)), np.zeros((0, 33), np.float64)
        found, bits = module.BinaryDescriptor_createBinaryDescriptor().compute(plain, found)
        lines = np.array([[(line.startPointX, line.startPointY), (line.endPointX, line.endPointY)]
                          for line in found], float)
        return lines, np.c_[bits, [line.angle for line in found]]

    def _follow(self, plain: np.ndarray, lines: np.ndarray, looks: Any) -> list[tuple[int, int]]:
        """Return pairs of lines before and now by the nearest descriptors."""
        assert self._last is not None
        _, before, _, old = self._last
        bits = np.unpackbits(looks[:, :-1].astype(np.uint8), axis=1).astype(int)
        other = np.unpackbits(old[:, :-1].astype(np.uint8), axis=1).astype(int)
        distance = np.abs(bits[:, None] - other).sum(axis=2)
        pairs = {}
        for j, i in enumerate(distance.argmin(axis=1)):
            moved = np.linalg.norm(lines[j] - before[i], axis=1)
            if (distance[j, i] < HAMMING and moved.max() < MOVED
                    and abs(looks[j, -1] - old[i, -1]) < TURNED):
                pairs[int(i)] = int(j)      # readers keep one line of a number
        return list(pairs.items())


FRONTS = [Front('qflsd_ros, ~/line_features', ours), Front('LSD, optical flow', Chain)]
if descriptors is not None:
    FRONTS.append(Front('LSD, LBD (PL-VINS)', Described))


def measure_one(task: Task) -> Figures:
    """Run one front end over one sequence."""
    source = _source(task.sequence)
    assert source.camera is not None
    take, pace = FRONTS[task.front].make(source.camera, task.shortest), Pace()
    messages, poses = [], []
    for count, frame in enumerate(islice(source, task.frames)):
        stamp = count * PERIOD if frame.stamp is None else frame.stamp
        due = pace.due(stamp, RATE)
        message = take(_gray(frame), due)
        if due:
            messages.append(message)
            poses.append(frame.pose)
    return figures(messages, np.array(poses), source.camera.matrix[0, 0])


def figures(messages: list[Message], poses: np.ndarray, focal: float) -> Figures:
    """Judge the messages of a sequence by the gates of PL-VINS and the true poses (N, 4, 4)."""
    observations: dict[int, list[int]] = {}
    for i, message in enumerate(messages):
        for line in message:
            observations.setdefault(line, []).append(i)
    # Unbroken, since the n-th observation is taken for that of the n-th frame.
    usable = {line: seen for line, seen in observations.items()
              if len(seen) >= OBSERVATIONS and seen[-1] - seen[0] == len(seen) - 1}
    right = [_near(poses[seen], np.array([messages[i][line] for i in seen]), focal)
             for line, seen in usable.items()]
    return Figures(float(np.mean([len(message) for message in messages])),
                   sum(map(len, usable.values())) / len(messages),
                   float(np.mean(right)) if right else float('nan'))


def _distances(points: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Return the distances of points (M, 2) from segments (N, 2, 2): (M, N)."""
    along = lines[:, 1] - lines[:, 0]
    offset = points[:, None] - lines[:, 0]
    share = np.clip((offset * along).sum(axis=2) / (along ** 2).sum(axis=1), 0, 1)
    return np.linalg.norm(offset - share[..., None] * along, axis=2)


def _near(poses: np.ndarray, ends: np.ndarray, focal: float) -> bool:
    """Return whether one line in space passes near all its observations, (K, 2, 2) normalised."""
    rays = np.concatenate([ends, np.ones((len(ends), 2, 1))], axis=2)
    turns, places = poses[:, :3, :3], poses[:, :3, 3] - poses[0, :3, 3]
    normals = np.einsum('kij,kj->ki', turns, np.cross(rays[:, 0], rays[:, 1]))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    planes_ = np.c_[normals, -(normals * places).sum(axis=1)]
    line = np.linalg.svd(planes_)[2][2:]    # two homogeneous points on it
    seen = [np.einsum('kji,kj->ki', turns, point[:3] - point[3] * places) for point in line]
    images = np.cross(*seen)
    off = np.einsum('kei,ki->ke', rays, images) / np.hypot(*images[:, :2].T)[:, None]
    return bool(focal * np.sqrt((off ** 2).mean()) < NEAR)


def _gray(frame: Frame) -> np.ndarray:
    return np.frombuffer(frame.data, np.uint8).reshape(frame.height, frame.width)


class _Room(SceneFrames):
    """The room, seen by a fast camera."""

    def _frames(self) -> Any:
        return islice(super()._frames(), 0, None, SPEED)


def _source(sequence: str) -> Source:
    return _Room(Scene(640, 480, 0.0)) if sequence == ROOM else open_source(sequence)


def measure(experiment: Experiment) -> str:
    """Write the section."""
    sequences = [ROOM, *(str(folder) for folder in experiment.sequences
                         if (folder / DESCRIPTION).exists())]
    frames = 4 * experiment.effort.frames
    tasks = [Task(front, sequence, frames, shortest) for sequence in sequences
             for shortest in LENGTHS for front in range(len(FRONTS))]
    rows = [(FRONTS[task.front].title, Path(task.sequence).name, number(task.shortest, 0),
             number(found.lines, 1), number(found.usable, 1), number(found.in_space))
            for task, found in each(measure_one, tasks, 'line features')]
    return section(
        'Line features',
        f'*lines*: mean number of lines in a message at {RATE:g} Hz, at most {MOST}; *usable*: '
        f'those that PL-VINS triangulates, seen in {OBSERVATIONS} or more successive messages; '
        f'*one line*: share of the usable ones whose observations are within {NEAR:g} px (root '
        f'mean square) of one line in space, by the true poses. *{ROOM}*, and folders with '
        'sequence.json. LSD and LBD have the settings of PL-VINS, which uses lines from '
        f'{LENGTHS[0]:g} px on, and images that are undistorted and equalised before. LBD is left '
        'out where OpenCV does not have it.',
        table(('front end', 'sequence', 'from px', 'lines', 'usable', 'one line'), rows))
