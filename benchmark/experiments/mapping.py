"""Lines in space from tracks and poses: the room, and recordings with poses."""
from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
import json
from pathlib import Path
import time
from typing import Any, NamedTuple

from benchmark.datasets import read_gray
from benchmark.experiment import Experiment
from benchmark.report import number, section, table
from benchmark.scenes.walk import EVERY, NEAR, Seen, Walk
import cv2
import numpy as np
from qflsd_ros.core import Tracker
from qflsd_ros.core.geometry import triangulation
from qflsd_ros.core.geometry.line_map import LineMap, MappedLines, VIEWS
from qflsd_ros.core.geometry.lines import Lines
from qflsd_ros.core.geometry.stereo import in_epipolar_planes, match, Sight
from qflsd_ros.core.geometry.views import FLAW, observed
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.pose import Pose
from scipy.spatial import cKDTree

NOISE = 2.0             # grey levels
LAMBDAS = 0.0, -0.5
FRAMES = 570            # of the room: 2 m
ESTIMATED = 90          # of these that lens and focal length are estimated from: 3 s
LEAST_SEEN = 10         # frames in which a line was seen, to count
SAMPLES = 11            # points along a line
LONG, COVERED = 0.3, 0.6    # m of an edge that must be in sight, and the share to be mapped
CLOSE = 0.01            # distance of a line that maps an edge, as a share of its depth
ALONG = np.cos(np.radians(5.0))
PUBLISHED = 15          # frames between two maps: 2 Hz
MEDIAN = 3.357          # of chi^2 with 4 degrees of freedom
SURFACE = 6, 2          # each how many-th frame and pixel gives a point of the surfaces
BASELINE = 0.2, 0.0, 0.0   # m, from the left camera to the right one
STEREO = 300            # frames of the room
LENGTH = 0.2            # m, of lines that are counted in recordings


class Cost(NamedTuple):
    """CPU time of a map, ms a frame and 100 lines: with a map at 2 Hz, and with each frame."""

    usual: float
    always: float


def mapped(seen: list[Seen]) -> MappedLines:
    """Return the map of images, made as the node makes it."""
    world = LineMap()
    for count, one in enumerate(seen, 1):
        world.add(one.tracks, one.planes, one.pose)
        if count % PUBLISHED == 0:
            world.lines()
    return world.lines()


def cost(seen: list[Seen]) -> Cost:
    """Measure the CPU time of a map."""
    times = []
    for every in (PUBLISHED, 1):
        world, begin = LineMap(), time.process_time()
        for count, one in enumerate(seen, 1):
            world.add(one.tracks, one.planes, one.pose)
            if count % every == 0:
                world.lines()
        times.append(1e5 * (time.process_time() - begin) / sum(len(one.tracks) for one in seen))
    return Cost(*times)


def samples(lines: Lines) -> np.ndarray:
    """Return points from end to end of lines: (N, SAMPLES, 3)."""
    start, end = lines.ends[:, None, 0], lines.ends[:, None, 1]
    return start + np.linspace(0, 1, SAMPLES)[:, None] * (end - start)


def distances(points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the distances of points, (..., 3), from the nearest of some edges, (E, 2, 3)."""
    start, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    flat = points.reshape(-1, 1, 3) - start
    share = np.clip((flat * along).sum(axis=2) / (along ** 2).sum(axis=1), 0, 1)
    off = np.linalg.norm(flat - share[..., None] * along, axis=2)
    return off.min(axis=1).reshape(points.shape[:-1])


def errors(lines: Lines, edges: np.ndarray) -> np.ndarray:
    """Return two shifts and two tilts of an edge from each line: (N, 4)."""
    along = edges[:, 1] - edges[:, 0]
    along = along / (along * lines.directions).sum(axis=1, keepdims=True)
    place = ((lines.points - edges[:, 0]) * lines.directions).sum(axis=1, keepdims=True)
    off = edges[:, 0] + place * along - lines.points
    return np.concatenate([np.einsum('nki,ni->nk', lines.across, vectors)
                           for vectors in (off, along)], axis=1)


def honesty(lines: Lines, edges: np.ndarray) -> float:
    """Return errors over stated deviations, from the median over all lines."""
    off = errors(lines, edges)
    squares = np.einsum('ni,nij,nj->n', off, np.linalg.inv(lines.covariances), off)
    return float(np.sqrt(np.median(squares) / MEDIAN))


def completeness(lines: Lines, edges: np.ndarray, visible: np.ndarray) -> tuple[float, int]:
    """Return the share of edges that are mapped, and how many can be."""
    found, bins = [], visible.shape[1]
    shares = (np.arange(bins) + 0.5) / bins
    for (start, end), seen in zip(edges, visible >= max(LEAST_SEEN / EVERY, 2)):
        length = float(np.linalg.norm(end - start))
        if seen.mean() * length < LONG:
            continue
        near = np.abs(lines.directions @ (end - start)) > ALONG * length
        points = start + shares[seen, None] * (end - start)
        if not near.any():
            found.append(0.0)
            continue
        reach = CLOSE * lines.distances[near]
        start_, along = lines.ends[near, 0], lines.ends[near, 1] - lines.ends[near, 0]
        flat = points[:, None] - start_
        at = np.clip((flat * along).sum(axis=2) / (along ** 2).sum(axis=1), 0, 1)
        off = np.linalg.norm(flat - at[..., None] * along, axis=2)
        found.append(float((off < reach).any(axis=1).mean()))
    return float(np.mean(np.array(found) >= COVERED)), len(found)


def views(seen: list[Seen], change: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return tracks, views and counts for triangulation, with other weights by ``change``."""
    rows: dict[int, list[np.ndarray]] = defaultdict(list)
    for one in seen:
        found, flaw = one.planes, FLAW
        if change == 'normals':
            found = found._replace(covariances=np.broadcast_to(np.eye(3), (len(one.tracks), 3, 3)))
        if change == 'ends':
            found = found._replace(covariances=np.zeros((len(one.tracks), 3, 3)))
        for track, row in zip(one.tracks.tolist(), observed(found, one.pose, flaw)):
            rows[track].append(row)
    tracks = np.array([track for track, some in rows.items() if len(some) >= LEAST_SEEN])
    result = np.stack([np.array(rows[track])[
        np.linspace(0, len(rows[track]) - 1, VIEWS).round().astype(int)] for track in tracks])
    return tracks, result, np.full(len(tracks), VIEWS)


def gains(seen: list[Seen], confirmed: np.ndarray, edges: dict[int, int], truth: np.ndarray
          ) -> dict[str, float]:
    """Return by how much weights by covariance lower the median error of the same lines."""
    middle = {}
    for change in ('', 'normals', 'ends'):
        tracks, rows, counts = views(seen, change)
        kept = np.array([track in edges and track in confirmed for track in tracks.tolist()])
        lines = triangulation.triangulate(rows[kept], counts[kept])
        true = truth[[edges[track] for track in tracks[kept].tolist()]]
        off = np.linalg.norm(errors(lines, true)[:, :2], axis=1)
        middle[change] = np.where(lines.views > 0, off, np.inf)
    return {change: 1 - float(np.median(middle['']) / np.median(middle[change]))
            for change in ('normals', 'ends')}


def room(lam: float, frames: range, shape: tuple[int, int], estimated: bool = False
         ) -> tuple[object, ...]:
    """Return a row of the table for the room through a lens, a known or an estimated one."""
    walk, title = Walk(lam, NOISE, shape), f'lambda {lam:g}'
    if estimated:
        bend, focal = walk.estimate(frames[:ESTIMATED])
        title += f', estimated ({bend:+.4f}, focal length {focal:+.2%})'
    seen = walk.see(frames)
    result = mapped(seen)
    often = result.seen >= LEAST_SEEN
    tracks, lines = result.tracks[often], result.lines.chosen(often)
    edges = walk.depicted(seen[::EVERY])
    on = np.array([track in edges for track in tracks.tolist()], bool)
    true = walk.edges[[edges[track] for track in tracks[on].tolist()]]
    off = 100 * distances(samples(lines), walk.edges) / lines.distances[:, None]
    share, count = completeness(lines, walk.edges, walk.visible(frames[::EVERY]))
    surfaces = 100 * walk.off_surfaces(samples(lines)) / lines.distances[:, None]
    gain, spent = gains(seen, tracks, edges, walk.edges), cost(seen)
    return (title, len(tracks), number(on.mean(), 2), *_percentiles(off[on]),
            *_percentiles(surfaces), f'{share:.3f} of {count}',
            number(honesty(lines.chosen(on), true)), number(gain['normals'], 2),
            number(gain['ends'], 2), number(spent.usual, 2), number(spent.always, 2))


def _percentiles(values: np.ndarray) -> tuple[str, str]:
    median, most = np.percentile(values, (50, 90)) if values.size else (np.nan, np.nan)
    return number(float(median), 2), number(float(most), 2)


class Recording:
    """A folder with sequence.json, as doc/camera.md describes it, and perhaps with depth."""

    def __init__(self, folder: Path) -> None:
        content: dict[str, Any] = json.loads((folder / 'sequence.json').read_text())
        self.folder, self.frames = folder, content['frames']
        self.matrix, self.scale = np.array(content['K'], float), content.get('depth_scale')
        self.camera = CameraModel('plumb_bob', self.matrix, np.array(content['distortion'], float))

    def see(self) -> list[Seen]:
        """Return what is seen in all images."""
        tracker, found = Tracker(), []
        for frame in self.frames:
            arcs = tracker.track(read_gray(self.folder / frame['image']))
            found.append(Seen.of(arcs, self.camera, np.array(frame['pose'])))
        return found

    def surfaces(self) -> np.ndarray:
        """Return points of the surfaces that the depth shows: (P, 3) m."""
        return np.concatenate(list(self._points()))

    def _points(self) -> Iterator[np.ndarray]:
        every, step = SURFACE
        for frame in self.frames[::every]:
            path = self.folder / frame['depth']
            depth = np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
            z = depth[::step, ::step].astype(float) / self.scale
            v, u = np.mgrid[0:depth.shape[0]:step, 0:depth.shape[1]:step]
            rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(self.matrix).T
            pose = Pose.from_matrix(np.array(frame['pose']))
            yield (rays * z[..., None])[z > 0] @ pose.rotation.T + pose.centre


def on_surfaces(recording: Recording) -> tuple[object, ...]:
    """Return a row: how far lines are from the surfaces."""
    result = mapped(recording.see())
    often = result.seen >= LEAST_SEEN
    lines = result.lines.chosen(often)
    off = 100 * np.asarray(cKDTree(recording.surfaces()).query(samples(lines))[0])
    long = lines.reaches[:, 1] - lines.reaches[:, 0] >= LENGTH
    return recording.folder.name, len(off), int(long.sum()), *_percentiles(off)


def left_out(recording: Recording) -> tuple[object, ...]:
    """Return a row: how far lines are from the arcs of an image that they were mapped without."""
    seen, off, count = recording.see(), [], []
    for number_, one in enumerate(seen):
        result = mapped(seen[:number_] + seen[number_ + 1:])
        _, mine, theirs = np.intersect1d(result.tracks, one.tracks, return_indices=True)
        lines = result.lines.chosen(mine)
        moments = np.cross(lines.points - one.pose.centre, lines.directions) @ one.pose.rotation
        moments /= np.linalg.norm(moments, axis=1, keepdims=True)
        across = np.abs(np.einsum('ni,nki->nk', moments, one.planes.ends[theirs]))
        off.append(recording.matrix[0, 0] * across.ravel())
        count.append(len(mine))
    return recording.folder.name, number(float(np.mean(count)), 1), *_percentiles(
        np.concatenate(off))


def stereo(lam: float, frames: range, shape: tuple[int, int]) -> tuple[object, ...]:
    """Return a row: matches of two cameras in the room."""
    one, two = Walk(lam, NOISE, shape), Walk(lam, NOISE, shape, BASELINE)
    here, there = one.see(frames), two.see(frames)
    mine, theirs = one.depicted(here[::EVERY]), two.depicted(there[::EVERY])
    counts = np.zeros(5)
    for left, right in list(zip(here, there))[EVERY::EVERY]:
        ours = np.array([mine.get(track, -1) for track in left.tracks.tolist()])
        others = np.array([theirs.get(track, -2) for track in right.tracks.tolist()])
        same = ours[:, None] == others
        first, second = one.parts(left, ours), two.parts(right, others)
        common = (np.minimum(first[:, None, 1], second[:, 1])
                  - np.maximum(first[:, None, 0], second[:, 0]))
        length = np.minimum(np.ptp(first, axis=1)[:, None], np.ptp(second, axis=1))
        pose = right.pose.relative_to(left.pose)
        epipolar = in_epipolar_planes(left.planes, pose.centre)
        both = (same & (common > length / 2)).any(axis=1) & ~epipolar
        found = match(Sight(left.planes, left.contrasts), Sight(right.planes, right.contrasts),
                      pose)
        (on, nearly), (there_on, there_nearly) = (
            [walk.distances(seen, near)[1][some] for near in (NEAR, 2 * NEAR)]
            for walk, seen, some in ((one, left, found.left), (two, right, found.right)))
        judged = on.any(axis=1) | there_on.any(axis=1)
        agree = ((on & there_nearly) | (nearly & there_on)).any(axis=1)
        counts += (judged.sum(), agree.sum(), both.sum(), both[found.left[agree]].sum(),
                   epipolar.mean())
    return (f'lambda {lam:g}', int(counts[0]), number(counts[1] / counts[0]), int(counts[2]),
            number(counts[3] / counts[2]), number(counts[4] / len(here[EVERY::EVERY]), 2))


def measure(experiment: Experiment) -> str:
    """Write the section."""
    triangulation.warm_up()
    every = experiment.effort.every
    # A part of the way does not determine the focal length.
    kinds = (False, True) if every == 1 else (False,)
    rows = [room(lam, range(FRAMES // every), experiment.effort.shape, estimated)
            for estimated in kinds for lam in LAMBDAS]
    posed = [Recording(folder) for folder in experiment.sequences
             if (folder / 'sequence.json').exists()]
    parts = [
        f'The room, noise {NOISE:g} grey levels, a camera with known poses that walks '
        f'{2 / every:.1f} m in {FRAMES // every} frames. Lines seen in {LEAST_SEEN} frames or '
        'more; distances of points from end to end of the lines, % of their depth: from the '
        'nearest true edge, of lines whose arcs depict one (within 2 px), and of all lines from '
        'the nearest surface, as the others are wood grain and joints of boards, which lie on '
        'surfaces and are no edges of the scene. estimated: lens and focal length are those that '
        f'the arcs of the first {ESTIMATED} frames show, with the errors in brackets, instead of '
        f'the true ones. mapped: share of the edges of {LONG:g} m in sight with '
        f'contrast that are mapped to {COVERED:.0%} within {CLOSE:.0%} of their depth; stated: '
        'errors over stated deviations; gain: by how much weights by covariance lower the median '
        'error against equal weights of the normals, and of the end points; ms: CPU time a frame '
        'and 100 lines, with maps at 2 Hz and with one each frame.',
        table(('lens', 'lines', 'on edges', 'median', 'p90', 'all, surface: median', 'p90',
               'mapped', 'stated', 'gain: normals', 'ends', 'ms', 'ms, each'), rows)]
    rows = [stereo(lam, range(STEREO // every), experiment.effort.shape) for lam in LAMBDAS]
    parts += [
        f'Two cameras in the room, {BASELINE[0]:g} m beside each other; every {EVERY}th of '
        f'{STEREO // every} frames. right: of the matches in which one line lies within '
        f'{NEAR:g} px of a true edge, those in which the other one lies within {2 * NEAR:g} px of '
        'the same; found: of the lines whose edge both cameras see, half of the shorter one in '
        'common, and that lie in no epipolar plane.',
        table(('lens', 'matches', 'right', 'in sight of both', 'found', 'in epipolar planes'),
              rows)]
    if deep := [on_surfaces(one) for one in posed if one.scale]:
        parts += [f'Recordings with poses and depth: distance from surfaces, cm; long: lines of '
                  f'{LENGTH:g} m and more.',
                  table(('recording', 'lines', 'long', 'median', 'p90'), deep)]
    if shallow := [left_out(one) for one in posed if not one.scale]:
        parts += ['Recordings with poses alone: distance across of the ends of arcs from lines '
                  'that were mapped without their image, px.',
                  table(('recording', 'lines in an image', 'median', 'p90'), shallow)]
    return section('Lines in space', *parts)
