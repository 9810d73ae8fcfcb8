"""The command demo: two processes over real DDS, watched from a third."""
from __future__ import annotations

import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import time
from typing import Callable

import cv2
import numpy as np
import pytest
from qflsd_ros.cli.leash import START
from qflsd_ros.cli.processes import Processes
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

ROOT = Path(__file__).parents[2]
TIMEOUT = 180.0  # s; generous: the machine may be busy, and kernels may have to be compiled
LINE = re.compile(r' *(\d+) s: in +(\d+), out +(\d+), arcs +(\d+), '
                  r'latency +([\d.]+) ms, p95 +([\d.]+) ms, age +([\d.]+) ms')


def start(*arguments: object, folder: Path | None = None) -> subprocess.Popen[str]:
    """Start the command as a process of its own."""
    return subprocess.Popen(
        [Path(sys.executable).with_name('demo'), *map(str, arguments)], text=True, cwd=folder,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={'AMENT_PREFIX_PATH': sys.prefix} | os.environ)


def until_results(process: subprocess.Popen[str]) -> list[int]:
    """Wait for the first line of figures; return camera and detector."""
    assert process.stdout is not None and process.stderr is not None
    while not LINE.match(process.stdout.readline()):
        assert process.poll() is None, process.stderr.read()
    started = children(process.pid)
    assert len(started) == 2
    return started


def all_gone(processes: list[int]) -> bool:
    """Return whether none of some processes runs any more; one that nobody waits for does not."""
    def runs(number: int) -> bool:
        try:
            status = Path('/proc', str(number), 'stat').read_text()
        except OSError:
            return False
        return status.rpartition(')')[2].split()[0] != 'Z'
    return not any(map(runs, processes))


def run(*arguments: object) -> tuple[int, str, str]:
    """Run the command to its end; return exit code, stdout and stderr."""
    process = start(*arguments)
    stdout, stderr = process.communicate(timeout=TIMEOUT)
    return process.returncode, stdout, stderr


def children(parent: int) -> list[int]:
    """Return the processes that a process has started and that still run."""
    found = []
    for status in Path('/proc').glob('[0-9]*/stat'):
        try:
            fields = status.read_text().rpartition(')')[2].split()
        except OSError:
            continue  # it has just ended
        if int(fields[1]) == parent and fields[0] != 'Z':
            found.append(int(status.parent.name))
    return found


def poll(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds, and fail when it never does."""
    deadline = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def check_video(path: Path) -> None:
    """Check that a video of about 3 s shows coloured arcs, and that nothing else is left."""
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    capture = cv2.VideoCapture(str(path))
    frames = []
    while (pixels := capture.read()[1]) is not None:
        frames.append(pixels)
    assert 60 <= len(frames) <= 200
    assert all(pixels.shape == (480, 640, 3) for pixels in frames)
    assert (np.ptp(frames[-1].astype(int), axis=2) > 100).any()
    assert (frames[0] != frames[-1]).any()


def test_it_says_what_comes_and_writes_pictures(tmp_path: Path) -> None:
    """A line a second with plausible figures, pictures of the scene, exit code 0."""
    pictured, video = tmp_path / 'pictures', tmp_path / 'films' / 'overlay.mp4'
    code, stdout, stderr = run('--seconds', 3, '--output', pictured, '--video', video)
    assert code == 0, stdout + stderr
    check_video(video)
    assert f'video in {video}' in stdout
    lines = [LINE.match(line) for line in stdout.splitlines()]
    rows = [tuple(map(float, match.groups())) for match in lines if match]
    assert [row[0] for row in rows] == [1, 2, 3]
    for _, frames, results, arcs, median, late, age in rows:
        assert frames > 0 and results > 0 and arcs > 10
        assert 0 < median <= late < 5000 and 0 < age < 5000
    pictures = sorted(pictured.iterdir())
    assert 2 <= len(pictures) <= 4
    assert f'{len(pictures)} pictures in {pictured}' in stdout
    shown = [cv2.imread(str(picture)) for picture in pictures]
    assert all(pixels.shape == (480, 640, 3) for pixels in shown)
    assert all((pixels.max(axis=2) - pixels.min(axis=2) > 100).any() for pixels in shown)


def test_of_a_folder_every_image_is_shown_once(tmp_path: Path) -> None:
    """Each image has its picture, however often the camera repeats it."""
    folder, output = tmp_path / 'a "folder"', tmp_path / 'pictures'
    folder.mkdir()
    for number in range(3):
        pixels = np.full((120, 160), 40, np.uint8)
        cv2.rectangle(pixels, (20 + 10 * number, 20), (100, 90), 200, -1)
        cv2.imwrite(str(folder / f'{number}.png'), pixels)
    code, stdout, stderr = run('--seconds', 3, '--input', folder, '--output', output)
    assert code == 0, stdout + stderr
    pictures = [cv2.imread(str(path)) for path in sorted(output.iterdir())]
    assert len(pictures) == 3
    assert len({pixels.tobytes() for pixels in pictures}) == 3


def make_bag(path: Path, count: int) -> None:
    """Record images of a rectangle at 20 Hz, years ago."""
    store = get_typestore(Stores.ROS2_JAZZY)
    image, header, stamp = (store.types[name] for name in (
        'sensor_msgs/msg/Image', 'std_msgs/msg/Header', 'builtin_interfaces/msg/Time'))
    pixels = np.full((120, 160), 40, np.uint8)
    cv2.rectangle(pixels, (20, 20), (100, 90), 200, -1)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/camera/image', image.__msgtype__, typestore=store)
        for number in range(count):
            time_ns = 1_600_000_000_000_000_000 + number * 50_000_000
            message = image(header(stamp(time_ns // 10**9, time_ns % 10**9), 'lens'),
                            120, 160, 'mono8', 0, 160, pixels.ravel())
            writer.write(connection, time_ns, store.serialize_cdr(message, image.__msgtype__))


def test_it_maps_the_room(tmp_path: Path) -> None:
    """The map is drawn beside the true edges: two views of both, in colour where lines are."""
    code, stdout, stderr = run('--map', '--seconds', 6, '--output', tmp_path)
    assert code == 0, stdout + stderr
    found = re.search(rf'^map of (\d+) lines in {tmp_path}/map.png$', stdout, re.MULTILINE)
    assert found and int(found[1]) > 20
    picture = cv2.imread(str(tmp_path / 'map.png')).astype(int)
    coloured = np.ptp(picture, axis=2) > 60
    half = picture.shape[1] // 2
    assert not coloured[:, :half].any() and coloured[:, half:].sum() > 500


def test_a_map_needs_poses(tmp_path: Path) -> None:
    code, _, stderr = run('--map', '--input', tmp_path)
    assert code == 2 and 'must be a folder with sequence.json' in stderr


def test_a_recording_is_played_with_its_stamps(tmp_path: Path) -> None:
    """Stamps of long ago say nothing of latency, and the lines do not pretend that they do."""
    make_bag(tmp_path / 'bag', 40)
    code, stdout, stderr = run('--seconds', 2, '--input', tmp_path / 'bag',
                               '--output', tmp_path / 'pictures')
    assert code == 0, stdout + stderr
    lines = [line for line in stdout.splitlines() if ' s: in ' in line]
    assert len(lines) == 2
    for line in lines:
        assert int(re.findall(r'out +(\d+)', line)[0]) > 0
        assert 'latency     - ms' in line and line.endswith('age (recorded)')
    assert cv2.imread(str(tmp_path / 'pictures' / '0001.png')).shape == (120, 160, 3)


def test_a_missing_input_ends_with_one_line(tmp_path: Path) -> None:
    """Exit code 2 at once, and the path in the line."""
    code, stdout, stderr = run('--input', tmp_path / 'nowhere', '--output', tmp_path)
    assert (code, stdout) == (2, '')
    [line] = stderr.splitlines()
    assert 'nowhere' in line and '--input' in line


def test_an_unreadable_input_ends_with_the_cameras_exit_code(tmp_path: Path) -> None:
    """The camera says why; nothing runs on."""
    (tmp_path / 'broken.png').write_text('no image')
    code, _, stderr = run('--input', tmp_path / 'broken.png', '--output', tmp_path / 'pictures')
    assert code == 2
    assert 'broken.png' in stderr and 'Traceback' not in stderr


def check_room_for_large_images(process: int) -> None:
    """Check that the packaged Fast DDS profile is in force, without a shell script's help."""
    environment = Path('/proc', str(process), 'environ').read_bytes().split(b'\0')
    file, = (text.partition(b'=')[2] for text in environment
             if text.startswith(b'FASTRTPS_DEFAULT_PROFILES_FILE='))
    assert Path(os.fsdecode(file)).read_text() == (ROOT / 'config/fastdds.xml').read_text()


@pytest.mark.parametrize('with_signal', [signal.SIGINT, signal.SIGTERM])
def test_no_process_outlives_it(tmp_path: Path, with_signal: signal.Signals) -> None:
    """A signal ends camera and detector with it."""
    process = start('--seconds', 1000, '--output', tmp_path)
    started = until_results(process)
    for number in started:
        check_room_for_large_images(number)
    process.send_signal(with_signal)
    _, stderr = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 130, stderr
    assert 'Traceback' not in stderr and str(tmp_path) in stderr
    poll(lambda: all_gone(started))


def test_no_process_outlives_it_when_it_is_killed(tmp_path: Path) -> None:
    """SIGKILL leaves it no time to end anything."""
    process = start('--seconds', 1000, '--output', tmp_path)
    started = until_results(process)
    process.kill()
    process.communicate(timeout=TIMEOUT)
    poll(lambda: all_gone(started))


def test_files_of_the_current_folder_are_no_modules(tmp_path: Path) -> None:
    """Python would take them for such, when started with -m or -c."""
    for name in ('numba', 'numpy', 'rclpy', 'yaml', 'threading'):
        (tmp_path / f'{name}.py').write_text('open("run", "w"); raise SystemExit(7)')
    process = start('--seconds', 1, '--output', tmp_path / 'pictures', folder=tmp_path)
    stdout, stderr = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 0, stdout + stderr
    assert not (tmp_path / 'run').exists()


def test_a_node_on_a_leash_ends_with_its_input() -> None:
    """Whichever thread has started it, and however early the end comes."""
    with Processes({'camera': [sys.executable, '-c', START, 'camera']}):
        pass
    process = subprocess.Popen([sys.executable, '-c', START, 'camera'], stdin=subprocess.DEVNULL)
    assert process.wait(TIMEOUT) == 0


def test_a_video_of_another_kind_is_refused(tmp_path: Path) -> None:
    """Exit code 2, before anything is started."""
    code, stdout, stderr = run('--video', tmp_path / 'overlay.gif')
    assert (code, stdout) == (2, '')
    assert 'overlay.gif' in stderr and 'must end in .mp4' in stderr
