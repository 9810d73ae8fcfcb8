"""The command ``detect``: images, videos and rosbag2s in; overlays, CSV, JSON and bags out."""
from __future__ import annotations

import argparse
from contextlib import closing
from dataclasses import replace
import os
from pathlib import Path
import sys
import time
from typing import Generator, Iterable, Iterator

import cv2
from qflsd_ros.cli import inputs, settings
from qflsd_ros.cli.inputs import Picture
from qflsd_ros.cli.interruption import Interrupted, raised
from qflsd_ros.cli.output import recordings
from qflsd_ros.cli.output.recordings import Recordings
from qflsd_ros.cli.output.writing import private_room
from qflsd_ros.cli.settings import Options, SettingsError
from qflsd_ros.cli.work import Outcome, Task, Work
from qflsd_ros.cli.workers import Workers
from qflsd_ros.sources.frames import Report, SourceError
from qflsd_ros.sources.opening import Kind, kind_of
from tqdm import tqdm

FAILED, USAGE = 1, 2  # exit codes; a signal that interrupts it gives 128 and its number


def tasks(pictures: Iterable[Picture], work: Work) -> Iterator[Task]:
    """
    Yield a task for each picture.

    Arcs in frames of a video or bag are detected here, in order, because lens and tracks follow
    from all frames before. Image files do not depend on each other: workers detect their arcs.
    """
    sequence, path = None, None
    for picture in pictures:
        if picture.frame is None:
            yield Task(picture)
            continue
        if sequence is None or picture.path != path:
            sequence, path = work.sequence(), picture.path
        found = work.found(picture, sequence)
        yield Task(replace(picture, pixels=None, message=None), found)


def outcomes(pictures: Iterable[Picture], options: Options, folder: Path, room: Path,
             jobs: int) -> Generator[Outcome, None, None]:
    """Process pictures in ``jobs`` processes; yield the outcome of each when it is finished."""
    work = Work(options, folder, room)  # compiles the kernels once, before the workers load them
    if jobs == 1:
        yield from map(work, tasks(pictures, work))
        return
    with Workers[Task, Outcome](jobs, start, options, folder, room) as workers:
        for task, outcome in workers.run(tasks(pictures, work)):
            yield outcome or Outcome(error=f'{str(task.picture.path)!r}: the process that worked '
                                     f'on {task.picture.name!r} was killed')


def start(options: Options, folder: Path, room: Path) -> Work:
    """Return the function that a worker process calls with its tasks."""
    cv2.setNumThreads(1)
    return Work(options, folder, room)


def readable(files: list[Path], topic: str, complain: Report, tell: Report) -> Iterator[Picture]:
    """Yield the pictures of all files; complain about videos and bags that cannot be read."""
    for path, name in zip(files, inputs.names(files)):
        try:
            yield from inputs.pictures(path, name, topic, complain, tell)
        except SourceError as error:
            complain(str(error))


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    result = argparse.ArgumentParser(
        prog='detect', allow_abbrev=False,
        description='Detects arcs in images and writes for each image an overlay (PNG), a table '
        'of the arcs (CSV), and arcs, lens and parameters (JSON). Flags override the parameter '
        'file.')
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
    result.add_argument('--node', default=settings.NODE, metavar='NAME',
                        help='full name of the node whose sections of that file are used '
                        '(default: %(default)s)')
    settings.add_flags(result)
    return result


def check(arguments: argparse.Namespace, files: list[Path], problems: list[str]) -> None:
    """Raise :class:`SettingsError` where there is no input, or results cannot be written."""
    if arguments.jobs < 1:
        raise SettingsError(f'--jobs is {arguments.jobs}: must be at least 1')
    if not files:
        raise SettingsError(f'no input found: {"; ".join(problems)}')
    check_places(arguments.output, files)
    try:
        arguments.output.mkdir(parents=True, exist_ok=True)
        with private_room(arguments.output):
            pass
    except OSError as error:
        raise SettingsError(f'--output {str(arguments.output)!r}: {error.strerror}') from error


def check_places(folder: Path, files: list[Path]) -> None:
    """Raise :class:`SettingsError` where results would overwrite an input or a bag."""
    names = inputs.names(files)
    written = {os.path.realpath(folder / f'{name}.png') for name in names}
    frames = {os.path.realpath(folder / name) for path, name in zip(files, names)
              if kind_of(path) is not Kind.IMAGE}
    for place in map(os.path.realpath, files):
        if place in written or os.path.dirname(place) in frames:
            raise SettingsError(f'{place!r} would be overwritten by results: choose another '
                                'folder by --output')
    for path, name in zip(files, names):
        bag = recordings.path_of(folder, name)
        if kind_of(path) is Kind.BAG and os.path.lexists(bag):
            raise SettingsError(f'{str(bag)!r} is already there: remove it or choose another '
                                'folder by --output')


def run(files: list[Path], problems: list[str], options: Options,
        arguments: argparse.Namespace) -> int:
    """Process all files, print a summary, and return the exit code."""
    begin, done, errors = time.perf_counter(), [], []
    folder, topic, jobs = arguments.output, arguments.topic, arguments.jobs
    total = sum(inputs.count(path, topic) for path in files)
    with tqdm(total=total, unit='image', disable=True if total == 1 else None) as progress:
        def tell(text: str) -> None:
            progress.write(f'detect: {text}', file=sys.stderr)

        def complain(text: str) -> None:
            errors.append(text)
            tell(text)

        for problem in problems:
            complain(problem)
        pictures = readable(files, topic, complain, tell)
        with private_room(folder) as room, Recordings(folder, room, complain) as bags, \
                closing(outcomes(pictures, options, folder, room, jobs)) as results:
            for outcome in results:
                progress.update()
                if outcome.error:
                    complain(outcome.error)
                    continue
                done.append(outcome)
                if outcome.cloud:
                    bags.write(outcome.cloud)
    milliseconds = 1e3 * sum(outcome.seconds for outcome in done) / max(1, len(done))
    said = summarise(f'{len(done)} images, {sum(outcome.arcs for outcome in done)} arcs in '
                     f'{time.perf_counter() - begin:.1f} s, {milliseconds:.2f} ms of detection '
                     f'(CPU) per image, {len(errors)} failed; results in {folder}')
    return FAILED if errors or not said else 0


def summarise(text: str) -> bool:
    """Print a line on stdout; return False where it could not be written, as on a full disk."""
    try:
        print(text, flush=True)
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)    # Python flushes it again at exit
        if not isinstance(error, BrokenPipeError):
            say(f'the summary cannot be written: {error.strerror}')
            return False
    return True


def main(args: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    arguments = parser().parse_args(args)
    try:
        with raised():
            files, problems = inputs.find(arguments.input)
            check(arguments, files, problems)
            return run(files, problems, settings.read(arguments, say), arguments)
    except SettingsError as error:
        say(str(error))
        return USAGE
    except Interrupted as error:
        say(f'interrupted by {error}; all files written so far are complete')
        return 128 + error.number
    except BrokenPipeError:     # the reader of stderr has ended
        return FAILED


def say(text: str) -> None:
    """Print a line on stderr."""
    print(f'detect: {text}', file=sys.stderr)


if __name__ == '__main__':
    sys.exit(main())
