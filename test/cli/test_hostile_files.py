"""Files that mean no good: a clear line, an exit code, and nothing half-written."""
from __future__ import annotations

import os
from pathlib import Path
import re
import resource
import signal
import struct
import subprocess
import sys
import time
import zlib

import cv2
import numpy as np
import pytest
from qflsd_ros.cli import inputs
from qflsd_ros.cli.detect import main
from qflsd_ros.cli.output.film import Film
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

TYPES = get_typestore(Stores.ROS2_JAZZY)
SMALL = 3000  # bytes: the results of a picture take more


def picture() -> np.ndarray:
    """Return bright rectangles on a dark ground: (300, 400, 3) uint8."""
    pixels = np.random.default_rng(0).integers(20, 40, (300, 400, 3), np.uint8)
    cv2.rectangle(pixels, (30, 40), (300, 250), (200, 180, 90), -1)
    return pixels


def write_image(path: Path) -> Path:
    path.write_bytes(cv2.imencode('.png', picture())[1].tobytes())
    return path


def write_bag(path: Path, count: int) -> Path:
    kind = 'sensor_msgs/msg/CompressedImage'
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/cam', kind, typestore=TYPES)
        for number in range(count):
            stamp = TYPES.types['builtin_interfaces/msg/Time'](number, 0)
            message = TYPES.types[kind](TYPES.types['std_msgs/msg/Header'](stamp, 'lens'), 'png',
                                        cv2.imencode('.png', picture())[1].ravel())
            writer.write(connection, number * 10**9, TYPES.serialize_cdr(message, kind))
    return path


def huge_png(width: int, height: int) -> bytes:
    """Return a few bytes that claim to be an image of a size."""
    header = b'IHDR' + struct.pack('>IIBBBBB', width, height, 8, 2, 0, 0, 0)
    return b'\x89PNG\r\n\x1a\n' + struct.pack('>I', 13) + header + struct.pack(
        '>I', zlib.crc32(header)) + cv2.imencode('.png', picture())[1].tobytes()[33:]


def run(capfd: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, list[str]]:
    """Run the command; return its exit code and its lines on stderr (libpng has its own)."""
    code = main(list(map(str, arguments)))
    return code, [line for line in capfd.readouterr().err.splitlines()
                  if line.startswith('detect: ')]


def left_over(folder: Path) -> list[Path]:
    """Return what nobody asked for."""
    return list(folder.rglob('.*'))


@pytest.mark.parametrize('content, text', [
    (huge_png(20000, 20000), 'has 20000 x 20000 pixels: both must lie in 1 to 32768'),
    (huge_png(2**31 - 1, 2**31 - 1), 'pixels: both must lie'),
    (cv2.imencode('.png', picture())[1].tobytes()[:9000], 'no image that can be read'),
    (b'', 'no image that can be read'), (b'\0' * 1000, 'no image that can be read')])
def test_a_bad_image_is_one_line_and_the_others_are_done(
        tmp_path: Path, capfd: pytest.CaptureFixture[str], content: bytes, text: str) -> None:
    write_image(tmp_path / 'good.png')
    (tmp_path / 'bad.png').write_bytes(content)
    code, (line,) = run(capfd, tmp_path, '--output', tmp_path / 'out')
    assert code == 1 and 'bad.png' in line and text in line
    assert sorted(path.name for path in (tmp_path / 'out').iterdir()) == [
        'good.csv', 'good.json', 'good.png']


def test_pipes_devices_and_links_in_a_circle(tmp_path: Path,
                                             capfd: pytest.CaptureFixture[str]) -> None:
    """None is waited for, none is read without end."""
    folder = tmp_path / 'in'
    folder.mkdir()
    write_image(folder / 'good.png')
    for name in ('pipe.png', 'video.mp4'):
        subprocess.run(['mkfifo', folder / name], check=True)
    (folder / 'zero.png').symlink_to('/dev/zero')
    (folder / 'loop.png').symlink_to(folder / 'loop.png')
    (folder / 'one.png').symlink_to(folder / 'other.png')
    (folder / 'other.png').symlink_to(folder / 'one.png')
    (folder / 'folder.png').mkdir()
    for name in 'abc':
        (folder / name).symlink_to(folder)  # 3 to the 40th paths, for who follows them
    begin = time.monotonic()
    bad = ['loop.png', 'one.png', 'other.png', 'pipe.png', 'video.mp4', 'zero.png']
    for argument, named in ((folder, ['folder.png', *bad]), (f'{folder}/**/*.*', bad)):
        code, lines = run(capfd, argument, '--output', tmp_path / 'out')
        assert code == 1 and (tmp_path / 'out' / 'good.csv').exists()
        assert len(lines) == len(named)
        assert all(f'/{name}' in line for name, line in zip(named, lines)), lines
    assert time.monotonic() - begin < 30


def test_names_with_newlines_and_other_signs(tmp_path: Path,
                                             capfd: pytest.CaptureFixture[str]) -> None:
    names = ['a\nb', 'c\td', '-flag', '~', 'e\udcff', 'x' * 240, '%s {} [1]']
    for name in names:
        write_image(tmp_path / f'{name}.png')
    (tmp_path / 'bad\nname.png').write_bytes(b'')
    code, (line,) = run(capfd, tmp_path, '--output', tmp_path / 'out')
    assert code == 1 and 'bad\\nname.png' in line
    assert {path.name for path in (tmp_path / 'out').iterdir()} == {
        f'{name}{suffix}' for name in names for suffix in ('.png', '.csv', '.json')}


def test_ten_thousand_files(tmp_path: Path) -> None:
    for number in range(10000):
        (tmp_path / f'{number}.png').touch()
    begin = time.monotonic()
    files, missing = inputs.find([str(tmp_path)])
    names = inputs.names(files)
    assert [int(name) for name in names] == list(range(10000)) and missing == []
    assert time.monotonic() - begin < 20


def test_a_full_disk(tmp_path: Path) -> None:
    """Results that cannot be written are named, each once; no part of them stays."""
    write_image(tmp_path / 'photo.png')
    bag = write_bag(tmp_path / 'drive', 3)
    result = subprocess.run(
        [sys.executable, '-m', 'qflsd_ros.cli.detect', str(tmp_path / 'photo.png'), str(bag),
         '--output', str(tmp_path / 'out')], capture_output=True, text=True, timeout=120,
        # As on a full disk, writing fails with an OSError; compiled code is kept already.
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (SMALL, SMALL)))
    assert result.returncode == 1 and 'Traceback' not in result.stderr
    lines = result.stderr.splitlines()
    assert len(lines) == 4 and all('cannot be written: ' in line for line in lines)
    assert result.stdout.startswith('0 images, ') and '4 failed' in result.stdout
    assert not left_over(tmp_path / 'out') and not list((tmp_path / 'out').rglob('*.*'))


def test_a_disk_too_full_for_a_bag(tmp_path: Path) -> None:
    """The files of each picture are there, the bag that could not be finished is not."""
    bag = write_bag(tmp_path / 'drive', 40)
    output = tmp_path / 'out'
    code = ('import resource, sys\n'
            'from qflsd_ros.cli import detect; from qflsd_ros.cli.output import results\n'
            'results.write = lambda *_: None\n'  # the bag alone is to be too large
            f'resource.setrlimit(resource.RLIMIT_FSIZE, ({SMALL}, {SMALL}))\n'
            f'sys.exit(detect.main([{str(bag)!r}, "--output", {str(output)!r}]))')
    result = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                            timeout=120)
    assert result.returncode == 1, result.stderr
    line, = result.stderr.splitlines()
    assert 'drive_segments' in line and 'cannot be written: ' in line
    assert list(output.iterdir()) == []


def test_a_bag_that_an_exception_cuts_short_is_not_there(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    heard = signal.signal(signal.SIGINT, signal.SIG_DFL)  # a shell's background jobs ignore it
    bag = write_bag(tmp_path / 'drive', 3)
    seen = []

    def interrupt(*_: object) -> None:
        seen.append(len(list((tmp_path / 'out').rglob('drive_segments'))))
        if len(seen) == 3:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr('qflsd_ros.cli.output.results.write', interrupt)
    try:
        assert main([str(bag), '--output', str(tmp_path / 'out')]) == 130
    finally:
        signal.signal(signal.SIGINT, heard)
    assert seen == [0, 1, 1]
    assert list((tmp_path / 'out').iterdir()) == []


def test_a_video_that_cannot_be_written_to_its_end(tmp_path: Path) -> None:
    path = tmp_path / 'film.mp4'
    code = ('import resource, time, numpy; from pathlib import Path\n'
            'from qflsd_ros.cli.output.film import Film\n'
            f'resource.setrlimit(resource.RLIMIT_FSIZE, ({SMALL}, {SMALL}))\n'
            f'with Film(Path({str(path)!r})) as film:\n'
            '    begin = time.monotonic()\n'
            '    while time.monotonic() - begin < 1:\n'
            '        film.show(numpy.random.default_rng(0).integers(\n'
            '            0, 255, (480, 640, 3), numpy.uint8))\n')
    result = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                            timeout=120)
    assert 'OSError' in result.stderr and 'could not be written to its end' in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_whole_video_is_taken_for_whole(tmp_path: Path) -> None:
    with Film(tmp_path / 'film.mp4') as film:
        begin = time.monotonic()
        while time.monotonic() - begin < 0.5:
            film.show(picture())
    assert [path.name for path in tmp_path.iterdir()] == ['film.mp4']


@pytest.mark.parametrize('text', [
    '[' * 5000, '&a [*a, *a]', '!!bool 3', '? [a]\n: b', '/**: &a {ros__parameters: *a}', '\x00',
    '%YAML 9', '{"/**": {ros__parameters: {tolerance: {a: [b: 1]}}}}',
    '{"": {ros__parameters: 1}}',
    '{"/**": {ros__parameters: {tolerance: 1.0e+999}}}', '{"/**": {ros__parameters: {[1]: 1}}}',
    '{"/**": {ros__parameters: {tolerance: .nan}}}',
    '{"/**": {ros__parameters: {tolerance: [1]}}}',
    f'{{"/**": {{ros__parameters: {{paper_seed: {"9" * 99}}}}}}}', '# ' + 'x' * (1 << 20)])
def test_a_parameter_file_that_means_no_good(
        tmp_path: Path, capfd: pytest.CaptureFixture[str], text: str) -> None:
    write_image(tmp_path / 'a.png')
    (tmp_path / 'p.yaml').write_text(text)
    code, (line,) = run(capfd, tmp_path, '--params', tmp_path / 'p.yaml', '--output',
                        tmp_path / 'out')
    assert code == 2 and 'p.yaml' in line


@pytest.mark.parametrize('text', [
    '{ros__parameters: &a {tolerance: *a}}', '{ros__parameters: {tolerance: [&a [1], *a, *a]}}',
    '{ros__parameters: {<<: [&a {tolerance: 1}, *a, *a]}}'])
def test_aliases_that_could_stand_for_gigabytes(
        tmp_path: Path, capfd: pytest.CaptureFixture[str], text: str) -> None:
    write_image(tmp_path / 'a.png')
    (tmp_path / 'p.yaml').write_text(f'# a bomb\n/**: {text}')
    code, (line,) = run(capfd, tmp_path, '--params', tmp_path / 'p.yaml', '--output',
                        tmp_path / 'out')
    assert code == 2 and re.search(r'p.yaml: .*line 2: alias \*a: .* must not have aliases', line)


def test_a_parameter_file_without_end(tmp_path: Path,
                                      capfd: pytest.CaptureFixture[str]) -> None:
    write_image(tmp_path / 'a.png')
    code, (line,) = run(capfd, tmp_path, '--params', '/dev/zero', '--output', tmp_path / 'out')
    assert code == 2 and '/dev/zero: cannot be read: has more than' in line


def test_links_in_the_output_folder_are_not_followed(
        tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Whoever can write into it cannot make the command write elsewhere."""
    photo, bag = write_image(tmp_path / 'photo.png'), write_bag(tmp_path / 'drive', 1)
    (tmp_path / 'elsewhere').mkdir()
    (tmp_path / 'victim').write_text('mine')
    output = tmp_path / 'out'
    output.mkdir()
    (output / 'photo.csv').symlink_to(tmp_path / 'victim')
    (output / f'.{os.getpid()}.part').symlink_to(tmp_path / 'victim')
    (output / 'drive').symlink_to(tmp_path / 'elsewhere')
    (output / '.drive_segments.part').symlink_to(tmp_path / 'elsewhere')
    code, (line,) = run(capfd, photo, bag, '--output', output)
    assert code == 1 and "'drive/000000' cannot be written: " in line
    assert (tmp_path / 'victim').read_text() == 'mine'
    assert not list((tmp_path / 'elsewhere').iterdir())
    assert (output / 'photo.csv').read_text().startswith('start_x') \
        and not (output / 'photo.csv').is_symlink()


def test_a_place_of_the_bag_that_is_a_link_to_nowhere(
        tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    bag = write_bag(tmp_path / 'drive', 1)
    (tmp_path / 'out').mkdir()
    (tmp_path / 'out' / 'drive_segments').symlink_to(tmp_path / 'nowhere')
    code, (line,) = run(capfd, bag, '--output', tmp_path / 'out')
    assert code == 2 and "drive_segments' is already there" in line


def test_an_output_folder_that_cannot_be_written(tmp_path: Path,
                                                 capfd: pytest.CaptureFixture[str]) -> None:
    photo = write_image(tmp_path / 'photo.png')
    for folder in ('/proc', '/proc/new'):   # not even root can
        code, (line,) = run(capfd, photo, '--output', folder)
        assert code == 2 and f"--output '{folder}': " in line
