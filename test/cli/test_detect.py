"""The command detect, from files to files."""
from __future__ import annotations

import csv
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Callable

import cv2
import numpy as np
import pytest
from qflsd_ros import overlay
from qflsd_ros.cli.detect import main
from qflsd_ros.core import Arcs, Detector, Parameters
from qflsd_ros.sources import Scene


def picture(seed: int, size: tuple[int, int] = (200, 150)) -> np.ndarray:
    """Return bright rectangles on a dark ground: (150, 200, 3) uint8."""
    generator = np.random.default_rng(seed)
    pixels = np.full((size[1], size[0], 3), 30, np.uint8)
    for _ in range(3):
        x, y = generator.integers(10, 60, 2).tolist()
        colour = generator.integers(100, 250, 3).tolist()
        cv2.rectangle(pixels, (x, y), (x + 100, y + 70), colour, -1)
    return pixels


def make_video(folder: Path, frames: int) -> Path:
    """Write a video ``v.avi`` of pictures and return its path."""
    path = folder / 'v.avi'
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*'MJPG'), 10, (200, 150))
    for number in range(frames):
        writer.write(picture(number))
    writer.release()
    return path


def poll(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    """Wait until a condition holds, and fail when it never does."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def group_exists(number: int) -> bool:
    """Tell whether a process group has a process left."""
    try:
        os.killpg(number, 0)
    except ProcessLookupError:
        return False
    return True


def expected(pixels: np.ndarray, parameters: Parameters = Parameters()) -> Arcs:
    """Return what the detector itself finds."""
    return Detector(parameters).detect(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with three images."""
    images = tmp_path / 'images'
    images.mkdir()
    for number in range(3):
        cv2.imwrite(str(images / f'{number}.png'), picture(number))
    return images


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command as a process of its own."""
    return subprocess.run([sys.executable, '-m', 'qflsd_ros.cli.detect', *map(str, arguments)],
                          capture_output=True, text=True, timeout=120)


def test_every_image_gets_three_files_that_say_the_same(folder: Path, tmp_path: Path) -> None:
    """Overlay, CSV and JSON hold what the detector found, with the parameters used."""
    output = tmp_path / 'results'
    assert main([str(folder), '--output', str(output), '--min_length', '20']) == 0
    assert sorted(path.name for path in output.iterdir()) == [
        f'{number}.{suffix}' for number in range(3) for suffix in ('csv', 'json', 'png')]
    parameters = Parameters(min_length=20.0)
    for number in range(3):
        pixels = picture(number)
        arcs = expected(pixels, parameters)
        assert len(arcs) >= 4
        drawn = cv2.imread(str(output / f'{number}.png'))
        np.testing.assert_array_equal(drawn, overlay.draw(pixels, arcs))
        check_csv(output / f'{number}.csv', arcs)
        check_json(output / f'{number}.json', arcs, parameters)


def check_csv(path: Path, arcs: Arcs) -> None:
    """Check that a CSV file holds every arc, to the last bit."""
    rows = list(csv.DictReader(path.open(newline='')))
    assert len(rows) == len(arcs)
    assert list(rows[0])[:4] == ['start_x', 'start_y', 'middle_x', 'middle_y']
    for name in ('start', 'end'):
        found = [[float(row[f'{name}_x']), float(row[f'{name}_y'])] for row in rows]
        np.testing.assert_array_equal(found, arcs.table[name])
    for name in ('curvature', 'length', 'rms', 'support'):
        np.testing.assert_array_equal([float(row[name]) for row in rows], arcs.table[name])


def test_the_lens_is_reported_where_a_picture_tells_it(tmp_path: Path) -> None:
    """JSON has lambda, and every arc its probability to be straight; else both are null."""
    cv2.imwrite(str(tmp_path / 'room.png'), Scene(640, 480, lam=-0.4).image(400))
    pixels = np.full((150, 200), 30, np.uint8)
    pixels[50:100, 60:140] = 200
    cv2.imwrite(str(tmp_path / 'plain.png'), pixels)
    assert main([str(tmp_path / '*.png'), '--output', str(tmp_path / 'out')]) == 0
    room, plain = (json.loads((tmp_path / 'out' / f'{name}.json').read_text())
                   for name in ('room', 'plain'))
    assert room['lens']['lambda'] == pytest.approx(-0.4, abs=0.02)
    assert 0 < room['lens']['deviation'] < 0.02 and room['lens']['agreeing'] > 20
    assert np.mean([arc['straight'] or 0.0 for arc in room['arcs']]) > 0.7
    assert plain['lens'] is None and [arc['straight'] for arc in plain['arcs']] == [None] * 4
    rows = csv.DictReader((tmp_path / 'out' / 'room.csv').open(newline=''))
    assert [float(row['straight']) for row in rows] == pytest.approx(
        [np.nan if arc['straight'] is None else arc['straight'] for arc in room['arcs']],
        nan_ok=True)


def check_json(path: Path, arcs: Arcs, parameters: Parameters) -> None:
    """Check that a JSON file holds image, parameters, arcs and their points."""
    found = json.loads(path.read_text())
    assert found['image'].endswith(path.with_suffix('.png').name) and found['frame'] is None
    assert (found['width'], found['height']) == (200, 150)
    assert Parameters(**found['parameters']) == parameters
    assert [arc['length'] for arc in found['arcs']] == arcs.table['length'].tolist()
    assert [arc['points'] for arc in found['arcs']] == [
        points.tolist() for points in arcs.polylines()]


def test_several_processes_give_the_same_files(folder: Path, tmp_path: Path) -> None:
    """``--jobs`` changes the time alone; the summary counts all images."""
    assert main([str(folder), '--output', str(tmp_path / 'one')]) == 0
    result = run(folder, '--output', tmp_path / 'two', '--jobs', 2)
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith('3 images, ')
    for path in (tmp_path / 'one').iterdir():
        assert path.read_bytes() == (tmp_path / 'two' / path.name).read_bytes()


def test_images_of_the_same_name_do_not_overwrite_each_other(tmp_path: Path) -> None:
    """Two folders with the same names give results for both."""
    for number, side in enumerate(('left', 'right')):
        (tmp_path / side).mkdir()
        cv2.imwrite(str(tmp_path / side / 'a.png'), picture(number))
    output = tmp_path / 'results'
    assert main([str(tmp_path / 'left'), str(tmp_path / 'right'), '--output', str(output)]) == 0
    assert {path.stem for path in output.iterdir()} == {'left_a', 'right_a'}
    check_csv(output / 'right_a.csv', expected(picture(1)))


def test_frames_of_a_video_are_numbered(tmp_path: Path) -> None:
    """A video gives a folder of its own with the results of each frame."""
    path = make_video(tmp_path, 3)
    assert main([str(path), '--output', str(tmp_path / 'results'), '--jobs', '2']) == 0
    assert len(list((tmp_path / 'results' / 'v').iterdir())) == 9
    found = json.loads((tmp_path / 'results' / 'v' / '000002.json').read_text())
    assert found['frame'] == 2 and len(found['arcs']) >= 4


@pytest.mark.parametrize('jobs', ['1', '2'])
def test_unreadable_files_are_named_and_the_others_done(
        folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], jobs: str) -> None:
    """Exit code 1; every bad input is on stderr, every good one has its results."""
    (folder / 'bad.png').write_text('no image')
    (folder / 'bad.mp4').write_text('no video')
    output = tmp_path / 'results'
    assert main([str(folder), 'nowhere.png', '--output', str(output), '--jobs', jobs]) == 1
    said = capfd.readouterr()
    for name in ('bad.png', 'bad.mp4', 'nowhere.png'):
        assert len([line for line in said.err.splitlines()
                    if line.startswith('detect: ') and name in line]) == 1
    assert said.out.startswith('3 images, ') and '3 failed' in said.out
    assert len(list(output.iterdir())) == 9


@pytest.mark.parametrize(('arguments', 'message'), [
    (['nowhere.png'], 'no input found'),
    (['{folder}', '--jobs', '0'], '--jobs is 0'),
    (['{folder}', '--tolerance', '-1'], 'tolerance is -1'),
    (['{folder}', '--params', 'nowhere.yaml'], 'nowhere.yaml'),
    (['{folder}', '--output', '{folder}/0.png'], '--output'),
    (['{folder}', '--output', '{folder}'], 'would be overwritten'),
])
def test_what_cannot_be_done_ends_with_one_line_and_exit_code_2(
        folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str],
        arguments: list[str], message: str) -> None:
    """The line says what was wrong; nothing is written."""
    arguments = [argument.format(folder=folder) for argument in arguments]
    assert main(['--output', str(tmp_path / 'results'), *arguments]) == 2
    [line] = capfd.readouterr().err.splitlines()
    assert line.startswith('detect: ') and message in line
    np.testing.assert_array_equal(cv2.imread(str(folder / '0.png')), picture(0))


def test_results_that_cannot_be_written_are_named(
        folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """A file in the way costs one image its results, half-written files do not stay."""
    output = tmp_path / 'results'
    (output / '1.csv').mkdir(parents=True)
    assert main([str(folder), '--output', str(output)]) == 1
    assert "'1' cannot be written" in capfd.readouterr().err
    assert (output / '2.json').exists()
    assert not [path for path in output.iterdir() if path.name.endswith('.part')]


def test_an_interrupt_ends_it_without_a_traceback(tmp_path: Path) -> None:
    """SIGINT to the whole group, as Ctrl-C sends it: exit code 130, one line, no process left."""
    path, output = make_video(tmp_path, 3000), tmp_path / 'results'
    process = subprocess.Popen(
        [sys.executable, '-m', 'qflsd_ros.cli.detect', str(path), '--output', str(output),
         '--jobs', '2'], stderr=subprocess.PIPE, text=True, start_new_session=True,
        # A shell's background jobs ignore SIGINT, and so would what they start.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    poll((output / 'v').exists)
    os.killpg(process.pid, signal.SIGINT)
    _, stderr = process.communicate(timeout=30)
    assert process.returncode == 130
    assert stderr.splitlines() == ['detect: interrupted; what is written is whole']
    poll(lambda: not group_exists(process.pid))
