"""The command ``detect``: images, videos and rosbag2s in; overlays, CSV, JSON and bags out."""
from __future__ import annotations

import argparse
from concurrent.futures import as_completed, FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
import multiprocessing
import os
from pathlib import Path
import sys
import time
from typing import Iterable, Iterator

import cv2
from qflsd_ros import rows
from qflsd_ros.cli import inputs, recordings, results, settings
from qflsd_ros.cli.inputs import Picture
from qflsd_ros.cli.interruption import deferred
from qflsd_ros.cli.recordings import Cloud, Recordings
from qflsd_ros.cli.settings import SettingsError
from qflsd_ros.core import (
    Arcs, Detector, estimate_distortion, Parameters, with_straightness)
from qflsd_ros.ros.node_parameters import NodeParameters
from qflsd_ros.sources.frames import Report, SourceError
from tqdm import tqdm

FAILED, USAGE, INTERRUPTED = 1, 2, 130  # exit codes


@dataclass(frozen=True)
class Outcome:
    """
    What came of one picture: arcs and CPU time (s) of their detection, or what went wrong.

    Of a recorded image, the segments as well.
    """

    arcs: int = 0
    seconds: float = 0.0
    error: str = ''
    cloud: Cloud | None = None


class Work:
    """Detects arcs in a picture and writes its results; sent to every worker process once."""

    def __init__(self, parameters: Parameters, folder: Path) -> None:
        """Take the parameters and the folder of the results, and make the detector ready."""
        self._folder = folder
        self._detector = Detector(parameters)
        self._detector.warm_up()

    def __call__(self, picture: Picture) -> Outcome:
        """Work on one picture."""
        try:
            pixels = picture.read()
            gray = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
            begin = time.process_time()
            arcs = self._detector.detect(gray)
            seconds = time.process_time() - begin
            lens = estimate_distortion([arcs], gray.shape)
            arcs = with_straightness(arcs, lens and lens.model)
            results.write(self._folder, picture, pixels, arcs, lens, self._detector.parameters)
        except SourceError as error:
            return Outcome(error=str(error))
        except OSError as error:
            return Outcome(error=f'results of {picture.name!r} cannot be written: {error}')
        return Outcome(len(arcs), seconds, cloud=_cloud(picture, arcs))


def _cloud(picture: Picture, arcs: Arcs) -> Cloud | None:
    if picture.moment is None:
        return None
    bag = picture.name.rpartition('/')[0]
    return Cloud(bag, picture.moment, rows.of_segments(arcs, NodeParameters.polyline_tolerance))


_work: Work | None = None  # of a worker process


def _start_worker(parameters: Parameters, folder: Path) -> None:
    global _work
    cv2.setNumThreads(1)
    _work = Work(parameters, folder)


def _run_worker(picture: Picture) -> Outcome:
    assert _work is not None
    return _work(picture)


def outcomes(pictures: Iterable[Picture], parameters: Parameters, folder: Path,
             jobs: int) -> Iterator[Outcome]:
    """Work on pictures in ``jobs`` processes; return what came of them as they are done."""
    work = Work(parameters, folder)  # compiles the kernels once, before the workers load them
    if jobs == 1:
        yield from map(work, pictures)
        return
    # In this order: the pool starts a process of multiprocessing's own, which unblocks SIGINT.
    with ProcessPoolExecutor(jobs, multiprocessing.get_context('spawn'), _start_worker,
                             (parameters, folder)) as pool, deferred() as check:
        running: set[Future[Outcome]] = set()
        for picture in pictures:
            check()
            running.add(pool.submit(_run_worker, picture))
            if len(running) == 2 * jobs:  # frames of a video must not pile up
                done, running = wait(running, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in done)
        yield from (future.result() for future in as_completed(running))


def readable(files: list[Path], topic: str, complain: Report, tell: Report) -> Iterator[Picture]:
    """Return the pictures of all files; complain about videos and bags that cannot be read."""
    for path, name in zip(files, inputs.names(files)):
        try:
            yield from inputs.pictures(path, name, topic, complain, tell)
        except SourceError as error:
            complain(str(error))


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    result = argparse.ArgumentParser(
        prog='detect', allow_abbrev=False,
        description='Finds the arcs in images and writes, for each, an overlay (PNG), a table '
        '(CSV) and everything (JSON).  Flags win over the parameter file.')
    result.add_argument('input', nargs='+', metavar='INPUT',
                        help='image, video, rosbag2, folder of images and videos, or glob '
                        'pattern')
    result.add_argument('--output', type=Path, default=Path('output'), metavar='DIR',
                        help='folder of the results (default: %(default)s)')
    result.add_argument('--jobs', type=int, default=1, metavar='N',
                        help='number of processes (default: %(default)s)')
    result.add_argument('--topic', default='', metavar='TOPIC',
                        help='topic of rosbag2s to read (default: the first with images)')
    result.add_argument('--params', type=Path, metavar='FILE',
                        help='ROS parameter file, as config/detector.yaml')
    settings.add_flags(result)
    return result


def check(arguments: argparse.Namespace, files: list[Path]) -> None:
    """Raise :class:`SettingsError` where nothing can be done, or too much would be."""
    if arguments.jobs < 1:
        raise SettingsError(f'--jobs is {arguments.jobs}: must be at least 1')
    if not files:
        raise SettingsError('no input found: INPUT must be an image, a video, a folder of them '
                            'or a glob pattern that matches some')
    folder = arguments.output
    written = {os.path.realpath(folder / f'{name}.png') for name in inputs.names(files)}
    for path in files:
        if os.path.realpath(path) in written:
            raise SettingsError(f'{str(path)!r} would be overwritten by its own results: '
                                'choose another folder by --output')
    for path, name in zip(files, inputs.names(files)):
        bag = recordings.path_of(folder, name)
        if inputs.is_bag(path) and bag.exists():
            raise SettingsError(f'{str(bag)!r} is already there: remove it or choose another '
                                'folder by --output')
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SettingsError(f'--output {str(folder)!r}: {error.strerror}') from error


def run(files: list[Path], missing: list[str], parameters: Parameters,
        arguments: argparse.Namespace) -> int:
    """Work on all files, say what came of it, and return the exit code."""
    begin, done, errors = time.perf_counter(), [], []
    folder, topic, jobs = arguments.output, arguments.topic, arguments.jobs
    total = sum(inputs.count(path, topic) for path in files)
    with tqdm(total=total, unit='image', disable=True if total == 1 else None) as progress:
        def tell(text: str) -> None:
            progress.write(f'detect: {text}', file=sys.stderr)

        def complain(text: str) -> None:
            errors.append(text)
            tell(text)

        for argument in missing:
            complain(f'{argument!r}: no such file, and no file matches it')
        pictures = readable(files, topic, complain, tell)
        with Recordings(folder, complain) as bags:
            for outcome in outcomes(pictures, parameters, folder, jobs):
                progress.update()
                if outcome.error:
                    complain(outcome.error)
                    continue
                done.append(outcome)
                if outcome.cloud:
                    bags.write(outcome.cloud)
    milliseconds = 1e3 * sum(outcome.seconds for outcome in done) / max(1, len(done))
    print(f'{len(done)} images, {sum(outcome.arcs for outcome in done)} arcs in '
          f'{time.perf_counter() - begin:.1f} s, {milliseconds:.2f} ms of detection (CPU) per '
          f'image, {len(errors)} failed; results in {folder}')
    return FAILED if errors else 0


def main(args: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    arguments = parser().parse_args(args)
    files, missing = inputs.find(arguments.input)
    try:
        check(arguments, files)
        parameters = settings.read(arguments)
    except SettingsError as error:
        print(f'detect: {error}', file=sys.stderr)
        return USAGE
    try:
        return run(files, missing, parameters, arguments)
    except KeyboardInterrupt:
        print('detect: interrupted; what is written is whole', file=sys.stderr)
        return INTERRUPTED


if __name__ == '__main__':
    sys.exit(main())
