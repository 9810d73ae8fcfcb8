"""The command ``demo``: runs a camera and the detector as processes and shows their results."""
from __future__ import annotations

import argparse
from contextlib import ExitStack
import json
import math
import os
from pathlib import Path
import random
import signal
import socket
import sys
import time
from typing import Callable

from qflsd_ros.cli.interruption import noted
from qflsd_ros.cli.leash import START
from qflsd_ros.cli.map_listener import MapListener
from qflsd_ros.cli.observer import Counts, Observer, Show
from qflsd_ros.cli.output.film import Film
from qflsd_ros.cli.output.gallery import Gallery
from qflsd_ros.cli.processes import ProcessError, Processes
from qflsd_ros.core.geometry import triangulation
from qflsd_ros.sources import Scene
from qflsd_ros.sources.files import IMAGE_SUFFIXES
from qflsd_ros.sources.sequence import DESCRIPTION
import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

# s until the first result must have come, or one more kernel be compiled; a kernel takes seconds
PATIENCE = 120.0
SPIN = 0.1  # s between two checks for a signal, which is at once for whoever presses Ctrl-C
STILLS_RATE = 10.0  # Hz, of still images; slow enough that a picture of each one is written
FAILED, USAGE, INTERRUPTED = 1, 2, 130  # exit codes, as of a shell's commands


class DemoError(Exception):
    """The demo cannot continue; the text gives the reason."""


def parse(args: list[str] | None) -> argparse.Namespace:
    """Return the arguments of the command line; exit with a message where one is invalid."""
    parser = argparse.ArgumentParser(
        prog='demo', description='Runs a camera and the detector for some seconds, prints '
        'rates and latencies once a second, and writes pictures with the arcs that are detected.')
    parser.add_argument('--seconds', type=float, default=20.0, metavar='N',
                        help='seconds to run, from the first result on (default: %(default)g)')
    parser.add_argument('--input', metavar='PATH',
                        help='image, folder, video, rosbag2 or number of a webcam '
                        '(default: a synthetic scene)')
    parser.add_argument('--output', type=Path, default=Path('output/demo'), metavar='DIR',
                        help='folder for the pictures (default: %(default)s)')
    parser.add_argument('--video', type=Path, metavar='FILE',
                        help='also write the pictures as a video; the name must end in .mp4')
    parser.add_argument('--map', action='store_true',
                        help='also map the lines in space, and write the map as a picture; '
                        'for the synthetic scene, or a folder with sequence.json')
    arguments = parser.parse_args(args)
    if not 0 < arguments.seconds < math.inf:
        parser.error(f'--seconds is {arguments.seconds}: must be above 0')
    if arguments.video and arguments.video.suffix != '.mp4':
        parser.error(f'--video is {str(arguments.video)!r}: must end in .mp4')
    source = arguments.input
    if source is not None and not source.isdigit() and not Path(source).exists():
        parser.exit(USAGE, f'demo: --input {source!r}: there is no such file or folder\n')
    if arguments.map and source is not None and not (Path(source) / DESCRIPTION).is_file():
        parser.error(f'--map needs poses: --input {source!r} must be a folder with {DESCRIPTION}')
    return arguments


def free_domain() -> int:
    """Return a ROS_DOMAIN_ID that no other process on this machine uses."""
    numbers = list(range(1, 100))
    random.shuffle(numbers)
    for number in numbers:
        # DDS has fixed ports for each domain; its first participant binds this one.
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(('', 7400 + 250 * number + 10))
            except OSError:
                continue
            return number
    raise DemoError('there is no free ROS_DOMAIN_ID: end some of the ROS programs running here')


def shows_stills(source: str | None) -> bool:
    """Return whether a source is an image or a folder of images, not a video, bag or scene."""
    if source is None:
        return False
    path = Path(source)
    if path.is_dir():
        return not any((path / name).exists() for name in ('metadata.yaml', DESCRIPTION))
    return path.suffix.lower() in IMAGE_SUFFIXES


def commands(source: str | None, maps: bool) -> dict[str, list[str]]:
    """Return the command lines of camera and detector, and of the mapper if ``maps``."""
    python = [sys.executable, '-c', START]
    camera = [*python, 'camera', '--ros-args']
    if source is not None:
        camera += ['-p', f'source:={json.dumps(source)}']  # quoted: a string, never a number
    if maps and source is not None:
        camera += ['-p', 'loop:=false']     # a second turn would map the same lines again
    if shows_stills(source):
        camera += ['-p', f'rate:={STILLS_RATE}']
    mapper = [*python, str(shared('examples/line_mapper.py')), '--ros-args', '-r',
              'planes:=detector/planes']
    return {'camera': camera, 'detector': [*python, 'detector']} | (
        {'mapper': mapper} if maps else {})


def shared(name: str) -> Path:
    """Return the path of a file outside the modules, in an installed package or a checkout."""
    package = Path(__file__).parents[1]
    shares = [folder / 'share' / 'qflsd_ros' for folder in package.parents]
    return next(file for share in (package.parent, *shares)
                if (file := share / name).is_file())


def prepare_environment() -> None:
    """Set a ROS domain of its own, on this machine only, and shared memory for large images."""
    os.environ.update(ROS_DOMAIN_ID=str(free_domain()), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(shared('config/fastdds.xml')))


def await_result(executor: Executor, observer: Observer, processes: Processes,
                 check: Callable[[], None]) -> None:
    """
    Spin until an image and its result have come; raise DemoError where they do not.

    The very first start compiles, for as long as the machine takes: time counts from the last
    progress.
    """
    deadline, progress = time.monotonic() + PATIENCE, ''
    while observer.counts is None:
        if observer.compiling != progress:
            deadline, progress = time.monotonic() + PATIENCE, observer.compiling
        executor.spin_once(SPIN)
        check()
        if not processes.running():
            raise DemoError('the camera ended before the first result')
        if time.monotonic() > deadline:
            raise DemoError(f'no image with its result came within {PATIENCE:.0f} s'
                            + (f' of the last report: {progress}' if progress else ''))


def watch(executor: Executor, observer: Observer, processes: Processes, seconds: float,
          check: Callable[[], None]) -> Counts:
    """Print a line each second until the time is over or the camera ends; return all counts."""
    total, begin, number = Counts(), time.monotonic(), 0
    while number < seconds and processes.running():
        number += 1
        end = begin + min(number, seconds)
        while (left := end - time.monotonic()) > 0:
            executor.spin_once(min(left, SPIN))
            check()
        counts = observer.take()
        total.add(counts)
        print(f'{number:3d} s: {counts}, {observer.age()}', flush=True)
    check()     # Ctrl-C ends the camera as well, and the loop with it
    return total


def run(arguments: argparse.Namespace, check: Callable[[], None]) -> None:
    """Run camera, detector and observer, and print the results; ``check`` is called often."""
    interval = 0.0 if shows_stills(arguments.input) else 1.0
    if arguments.map:
        triangulation.warm_up()     # else the mapper compiles while the first lines come
    with ExitStack() as stack:
        gallery = stack.enter_context(Gallery(arguments.output, interval))
        shows: list[Show] = [gallery.show]
        if arguments.video:
            film = stack.enter_context(Film(arguments.video))
            shows.append(lambda pixels, _: film.show(pixels))
        processes = stack.enter_context(Processes(
            commands(arguments.input, arguments.map)))
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        observer = Observer(shows)
        listener = MapListener(observer) if arguments.map else None
        executor = SingleThreadedExecutor()
        executor.add_node(observer)
        await_result(executor, observer, processes, check)
        total = watch(executor, observer, processes, arguments.seconds, check)
        executor.shutdown()
        observer.destroy_node()
        rclpy.shutdown()
    print(f'total: {total}')
    if not gallery.paths:
        raise DemoError('no picture has come')
    print(f'{len(gallery.paths)} pictures in {arguments.output}: '
          f'{gallery.paths[0].name} to {gallery.paths[-1].name}')
    if arguments.video:
        print(f'video in {arguments.video}')
    if listener:
        truth = Scene().edges if arguments.input is None else None
        path = listener.write(arguments.output, truth)
        print(f'map of {len(listener.tracks)} lines in {path}')


def main(args: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    arguments = parse(args)
    check = noted(signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    try:
        prepare_environment()
        print(f'Starting camera and detector, ROS_DOMAIN_ID={os.environ["ROS_DOMAIN_ID"]} '
              '(the very first start compiles for about a minute) ...', flush=True)
        run(arguments, check)
    except (DemoError, ProcessError) as error:
        print(f'demo: {error}', file=sys.stderr)
        return error.code if isinstance(error, ProcessError) else FAILED
    except OSError as error:
        print(f'demo: results cannot be written: {error}', file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print(f'demo: interrupted; pictures written so far are in {arguments.output}',
              file=sys.stderr)
        return INTERRUPTED
    return 0


if __name__ == '__main__':
    sys.exit(main())
