"""The command ``demo``: a camera and the detector as two processes, watched from a third."""
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

from qflsd_ros.cli.film import Film
from qflsd_ros.cli.gallery import Gallery
from qflsd_ros.cli.interruption import noted
from qflsd_ros.cli.leash import START
from qflsd_ros.cli.observer import Counts, Observer
from qflsd_ros.cli.processes import ProcessError, Processes
from qflsd_ros.sources.files import IMAGE_SUFFIXES
import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

# s until the first result must have come: the first start compiles, for minutes on slow boards.
PATIENCE = 600.0
SPIN = 0.1  # s, after which it is looked whether a signal has come
STILLS_RATE = 10.0  # Hz, of still images: each one's picture is to be written
FAILED, USAGE, INTERRUPTED = 1, 2, 130  # exit codes


class DemoError(Exception):
    """The demo cannot go on; the text says why."""


def parse(args: list[str] | None) -> argparse.Namespace:
    """Return the arguments of the command line, checked."""
    parser = argparse.ArgumentParser(
        prog='demo', description='Runs a camera and the detector for a while, prints a line a '
        'second on what comes out and writes pictures of it.')
    parser.add_argument('--seconds', type=float, default=20.0, metavar='N',
                        help='how long, from the first result on (default: %(default)g)')
    parser.add_argument('--input', metavar='PATH',
                        help='image, folder, video, rosbag2 or number of a webcam '
                        '(default: a synthetic scene)')
    parser.add_argument('--output', type=Path, default=Path('output/demo'), metavar='DIR',
                        help='folder of the pictures (default: %(default)s)')
    parser.add_argument('--video', type=Path, metavar='FILE',
                        help='write the overlay as a video, too; its name ends in .mp4')
    arguments = parser.parse_args(args)
    if not 0 < arguments.seconds < math.inf:
        parser.error(f'--seconds is {arguments.seconds}: must be above 0')
    if arguments.video and arguments.video.suffix != '.mp4':
        parser.error(f'--video is {str(arguments.video)!r}: must end in .mp4')
    source = arguments.input
    if source is not None and not source.isdigit() and not Path(source).exists():
        parser.exit(USAGE, f'demo: --input {source!r}: there is no such file or folder\n')
    return arguments


def free_domain() -> int:
    """Return a ROS_DOMAIN_ID that nobody on this machine uses."""
    numbers = list(range(1, 100))
    random.shuffle(numbers)
    for number in numbers:
        # DDS has fixed ports for each domain; the first participant takes this one.
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(('', 7400 + 250 * number + 10))
            except OSError:
                continue
            return number
    raise DemoError('there is no free ROS_DOMAIN_ID: end some of the ROS programs running here')


def shows_stills(source: str | None) -> bool:
    """Tell an image or a folder of images from what moves."""
    if source is None:
        return False
    path = Path(source)
    if path.is_dir():
        return not (path / 'metadata.yaml').exists()
    return path.suffix.lower() in IMAGE_SUFFIXES


def commands(source: str | None) -> dict[str, list[str]]:
    """Return the command lines of camera and detector."""
    python = [sys.executable, '-c', START]
    camera = [*python, 'camera', '--ros-args']
    if source is not None:
        camera += ['-p', f'source:={json.dumps(source)}']  # quoted: a number is no index else
    if shows_stills(source):
        camera += ['-p', f'rate:={STILLS_RATE}']
    return {'camera': camera, 'detector': [*python, 'detector']}


def profiles() -> Path:
    """Return the Fast DDS profile of the package, whether that is installed or a checkout."""
    package = Path(__file__).parents[1]
    shares = [folder / 'share' / 'qflsd_ros' for folder in package.parents]
    return next(file for share in (package.parent, *shares)
                if (file := share / 'config' / 'fastdds.xml').is_file())


def prepare_environment() -> None:
    """Choose a domain of our own on this machine, with room for large images."""
    os.environ.update(ROS_DOMAIN_ID=str(free_domain()), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(profiles()))


def await_result(executor: Executor, observer: Observer, processes: Processes,
                 check: Callable[[], None]) -> None:
    """Spin until an image and a result have come; DemoError where they do not."""
    deadline = time.monotonic() + PATIENCE
    while observer.counts is None:
        executor.spin_once(SPIN)
        check()
        if not processes.running():
            raise DemoError('the camera ended before the first result')
        if time.monotonic() > deadline:
            raise DemoError(f'no image with its result came within {PATIENCE:.0f} s')


def watch(executor: Executor, observer: Observer, processes: Processes, seconds: float,
          check: Callable[[], None]) -> Counts:
    """Print a line a second for a while, or until the camera ends; return what came in all."""
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
    check()     # Ctrl-C ends the camera as well
    return total


def run(arguments: argparse.Namespace, check: Callable[[], None]) -> None:
    """Run camera, detector and observer, and say what came of it; ``check`` is called often."""
    interval = 0.0 if shows_stills(arguments.input) else 1.0
    with ExitStack() as stack:
        gallery = stack.enter_context(Gallery(arguments.output, interval))
        shows = [gallery.show]
        if arguments.video:
            film = stack.enter_context(Film(arguments.video))
            shows.append(lambda pixels, _: film.show(pixels))
        processes = stack.enter_context(Processes(commands(arguments.input)))
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        observer = Observer(shows)
        executor = SingleThreadedExecutor()
        executor.add_node(observer)
        await_result(executor, observer, processes, check)
        total = watch(executor, observer, processes, arguments.seconds, check)
        executor.shutdown()
        observer.destroy_node()
        rclpy.shutdown()
    print(f'in all: {total}')
    if not gallery.paths:
        raise DemoError('no picture came')
    print(f'{len(gallery.paths)} pictures in {arguments.output}: '
          f'{gallery.paths[0].name} to {gallery.paths[-1].name}')
    if arguments.video:
        print(f'video in {arguments.video}')


def main(args: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    arguments = parse(args)
    check = noted(signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    try:
        prepare_environment()
        print(f'Starting camera and detector, ROS_DOMAIN_ID={os.environ["ROS_DOMAIN_ID"]} '
              '(the first time ever, compiling takes half a minute) ...', flush=True)
        run(arguments, check)
    except (DemoError, ProcessError) as error:
        print(f'demo: {error}', file=sys.stderr)
        return error.code if isinstance(error, ProcessError) else FAILED
    except OSError as error:
        print(f'demo: results cannot be written: {error}', file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print(f'demo: interrupted; the pictures so far are in {arguments.output}', file=sys.stderr)
        return INTERRUPTED
    return 0


if __name__ == '__main__':
    sys.exit(main())
