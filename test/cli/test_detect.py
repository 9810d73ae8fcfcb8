"""The command detect, from files to files."""
from __future__ import annotations

import csv
import json
import os
from pathlib import Path
import subprocess
import sys
import time
from typing import Callable

import cv2
import numpy as np
import pytest
from qflsd_ros import overlay
from qflsd_ros.attitude_drawing import HORIZON
from qflsd_ros.cli.detect import main
from qflsd_ros.cli.settings import Options
from qflsd_ros.core import (
    Arcs, AttitudeTracker, Detector, estimate_attitude, estimate_distortion, Parameters, Tracker)
from qflsd_ros.ros.finding import FrameSequence
from qflsd_ros.ros.parameters.node_parameters import Settings
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
    assert found['parameters'] == Options(parameters, Settings()).values()
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


def test_a_reader_that_leaves_is_no_error(folder: Path, tmp_path: Path) -> None:
    """As of ``detect ... | true``: the results are there, nothing is said."""
    reading, writing = os.pipe()
    os.close(reading)
    result = subprocess.run(
        [sys.executable, '-m', 'qflsd_ros.cli.detect', str(folder), '--output',
         str(tmp_path / 'out')], stdout=writing, stderr=subprocess.PIPE, text=True, timeout=120)
    os.close(writing)
    assert (result.returncode, result.stderr) == (0, '')
    assert len(list((tmp_path / 'out').iterdir())) == 9


def test_a_summary_that_cannot_be_written_is_one_line(folder: Path, tmp_path: Path) -> None:
    with open('/dev/full', 'w') as full:
        result = subprocess.run(
            [sys.executable, '-m', 'qflsd_ros.cli.detect', str(folder), '--output',
             str(tmp_path / 'out')], stdout=full, stderr=subprocess.PIPE, text=True, timeout=120)
    assert result.returncode == 1
    assert result.stderr == 'detect: the summary cannot be written: No space left on device\n'


def test_a_folder_without_pictures_is_called_that(
        folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Alone it is all there is, beside others it is one of the failures."""
    empty, output = tmp_path / 'empty', str(tmp_path / 'out')
    empty.mkdir()
    (empty / 'notes.txt').touch()
    assert main([str(empty), '--output', output]) == 2
    assert "empty': no image or video in this folder: their names must end in .bmp, " \
        in capfd.readouterr().err
    assert main([str(folder), str(empty), 'x' * 300, '--output', output]) == 1
    said = capfd.readouterr()
    assert "empty': no image or video in this folder" in said.err
    assert f'{"x" * 300}\': no such file' in said.err
    assert said.out.startswith('3 images, ') and '2 failed' in said.out


@pytest.mark.parametrize('suffix', ['.jfif', '.jpe', '.pbm', '.pnm', '.dib'])
def test_every_suffix_of_a_format_that_is_read_is_that_of_an_image(
        tmp_path: Path, suffix: str) -> None:
    pixels = np.full((60, 80), 255, np.uint8)
    pixels[20:40, 20:60] = 0
    form = '.jpg' if suffix == '.jfif' else suffix
    (tmp_path / f'a{suffix}').write_bytes(cv2.imencode(form, pixels)[1].tobytes())
    for number, argument in enumerate((tmp_path, tmp_path / f'a{suffix}')):
        output = tmp_path / str(number)
        assert main([str(argument), '--output', str(output)]) == 0
        assert len(json.loads((output / 'a.json').read_text())['arcs']) == 4


def ten_bits() -> np.ndarray:
    """Return a picture of 10 bits, (150, 200) uint16."""
    return picture(0)[..., 0] * np.uint16(4)


@pytest.mark.parametrize('white, arcs', [('1023', 4), ('0', 0)])
def test_white_level(tmp_path: Path, white: str, arcs: int) -> None:
    """A PNG does not say that its 16 bits hold 10."""
    cv2.imwrite(str(tmp_path / 'a.png'), ten_bits())
    assert main([str(tmp_path / 'a.png'), '--white_level', white, '--output',
                 str(tmp_path / 'out')]) == 0
    found = json.loads((tmp_path / 'out' / 'a.json').read_text())
    # As 16 bits, the whole picture spans 4 grey levels.
    assert len(found['arcs']) >= arcs
    assert all((arc['contrast'] > 10) == bool(arcs) for arc in found['arcs'])
    drawn = cv2.imread(str(tmp_path / 'out' / 'a.png'))
    assert (drawn.max() > 200) == bool(arcs)


@pytest.mark.parametrize('head', [b'P5 200 150 1023\n', b'P5\n# 9\n200 150\n#7\n1023\n'])
def test_white_of_a_pgm_is_what_it_says(tmp_path: Path, head: bytes) -> None:
    (tmp_path / 'a.pgm').write_bytes(head + ten_bits().astype('>u2').tobytes())
    assert main([str(tmp_path / 'a.pgm'), '--output', str(tmp_path / 'out')]) == 0
    gray = cv2.convertScaleAbs(ten_bits(), alpha=255 / 1023)
    check_csv(tmp_path / 'out' / 'a.csv', Detector().detect(gray))


def test_a_lens_is_followed_from_frame_to_frame_of_a_video_alone(tmp_path: Path) -> None:
    """A dull frame knows the lens by those before it; a dull image file does not."""
    room = cv2.cvtColor(Scene(640, 480, lam=-0.4).image(400), cv2.COLOR_GRAY2BGR)
    dull = np.full_like(room, 90)
    for jobs in ('1', '2'):
        for name in 'v', 'w':
            writer = cv2.VideoWriter(str(tmp_path / f'{name}.avi'),
                                     cv2.VideoWriter_fourcc(*'MJPG'), 10, (640, 480))
            for pixels in (room, dull) if name == 'v' else (dull, dull):
                writer.write(pixels)
            writer.release()
        cv2.imwrite(str(tmp_path / 'x.png'), dull)
        output = tmp_path / jobs
        assert main([*(str(tmp_path / name) for name in ('v.avi', 'w.avi', 'x.png')),
                     '--output', str(output), '--jobs', jobs]) == 0
        lenses = [json.loads((output / f'{name}.json').read_text())['lens']
                  for name in ('v/000000', 'v/000001', 'w/000000', 'w/000001', 'x')]
        assert [lens['lambda'] for lens in lenses[:2]] == pytest.approx([-0.4, -0.4], abs=0.03)
        assert lenses[2:] == [None] * 3


def test_a_lens_that_is_given(folder: Path, tmp_path: Path) -> None:
    assert main([str(folder / '0.png'), '--lens', 'fixed', '--lens_lambda', '-0.3',
                 '--output', str(tmp_path / 'out')]) == 0
    found = json.loads((tmp_path / 'out' / '0.json').read_text())
    assert found['lens'] == {'lambda': -0.3, 'centre': [99.5, 74.5], 'deviation': None,
                             'agreeing': None, 'share': None}
    assert all(arc['straight'] is not None for arc in found['arcs'])


def test_what_looks_at_a_part_of_the_image(folder: Path, tmp_path: Path,
                                           capfd: pytest.CaptureFixture[str]) -> None:
    """Region, mask and largest width count; what does not fit is named."""
    output, image = str(tmp_path / 'out'), str(folder / '0.png')

    def arcs(*flags: str) -> list[dict]:
        assert main([image, '--output', output, *flags]) == 0
        return json.loads((tmp_path / 'out' / '0.json').read_text())['arcs']

    mask = np.full((150, 200), 255, np.uint8)
    mask[:, 100:] = 0
    cv2.imwrite(str(tmp_path / 'mask.png'), mask)
    assert max(arc['end'][0] for arc in arcs()) > 110
    for flags in (('--roi_width', '100'), ('--mask', str(tmp_path / 'mask.png'))):
        found = arcs(*flags)
        assert found and max(point[0] for arc in found for point in arc['points']) < 108
    assert arcs('--max_width', '100') != arcs()
    assert main([image, '--output', output, '--roi_x', '500']) == 1
    assert "0.png': region begins at roi_x 500" in capfd.readouterr().err
    assert main([image, '--output', output, '--mask', 'nowhere.png']) == 2
    assert "mask 'nowhere.png': No such file" in capfd.readouterr().err


def test_points_are_as_close_as_the_parameter_says(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / 'room.png'), Scene(640, 480, lam=-0.4).image(400))
    counts = []
    for tolerance in ('0.01', '1.0'):
        assert main([str(tmp_path / 'room.png'), '--polyline_tolerance', tolerance, '--output',
                     str(tmp_path / 'out')]) == 0
        found = json.loads((tmp_path / 'out' / 'room.json').read_text())
        counts.append(sum(len(arc['points']) for arc in found['arcs']))
    assert counts[0] > 1.3 * counts[1]


def test_inputs_are_not_overwritten_by_frames(tmp_path: Path,
                                              capfd: pytest.CaptureFixture[str]) -> None:
    """Frames that somebody has taken out of a video lie where its results would."""
    video = make_video(tmp_path, 2)
    (tmp_path / 'v').mkdir()
    cv2.imwrite(str(tmp_path / 'v' / '000000.png'), picture(7))
    assert main([str(video), str(tmp_path / 'v'), '--output', str(tmp_path)]) == 2
    assert "v/000000.png' would be overwritten" in capfd.readouterr().err
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / 'v' / '000000.png')), picture(7))


def test_lines_of_a_video_keep_their_tracks_and_images_have_none(tmp_path: Path) -> None:
    """As a tracker of its own for each video gives them, whoever draws the frames."""
    scene, videos = Scene(320, 240, lam=-0.3, colour=True), []
    for name, first in (('a', 400), ('b', 400)):
        path = tmp_path / f'{name}.avi'
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*'MJPG'), 10, (320, 240))
        for number in range(6):
            writer.write(scene.image(first + number))
        writer.release()
        videos.append(str(path))
    cv2.imwrite(str(tmp_path / 'photo.png'), scene.image(400))
    output = tmp_path / 'out'
    assert main([*videos, str(tmp_path / 'photo.png'), '--lens', 'off', '--jobs', '2',
                 '--trails', '3', '--output', str(output)]) == 0

    def rows(name: str) -> list[dict[str, str]]:
        return list(csv.DictReader((output / f'{name}.csv').open(newline='')))
    capture, tracker = cv2.VideoCapture(videos[0]), Tracker()
    for number in range(6):
        gray = cv2.cvtColor(capture.read()[1], cv2.COLOR_BGR2GRAY)
        table = tracker.track(gray).table
        found = rows(f'a/{number:06d}')
        for name in ('track', 'age', 'held'):
            assert [int(row[name]) for row in found] == table[name].tolist()
        assert rows(f'b/{number:06d}') == found
        arcs = json.loads((output / f'a/{number:06d}.json').read_text())['arcs']
        assert [arc['track'] for arc in arcs] == table['track'].tolist()
    assert np.median(table['age']) > 3
    assert list(found[0])[-4:] == ['straight', 'track', 'age', 'held']
    assert 'track' not in rows('photo')[0]

    assert main([videos[0], '--tracking', 'false', '--output', str(tmp_path / 'plain')]) == 0
    text = (tmp_path / 'plain' / 'a' / '000005.csv').read_text()
    assert 'straight' in text and 'track' not in text


def read_json(path: Path) -> dict:
    return json.loads(path.read_text())


def test_the_attitude_is_reported_where_it_is_wanted(tmp_path: Path) -> None:
    """As ``estimate_attitude`` gives it; where a picture shows none, the reason is there."""
    room = Scene(640, 480, lam=-0.4).image(400)
    cv2.imwrite(str(tmp_path / 'room.png'), room)
    cv2.imwrite(str(tmp_path / 'plain.png'), picture(0))
    inputs, output = str(tmp_path / '*.png'), tmp_path / 'out'
    assert main([inputs, '--attitude', 'true', '--output', str(output)]) == 0
    arcs = Detector().detect(room)
    found = estimate_attitude(arcs, room.shape, estimate_distortion([arcs], room.shape))
    told = read_json(output / 'room.json')
    assert told['attitude'] == {
        'up': found.up.tolist(), 'roll': pytest.approx(0, abs=1),
        'pitch': pytest.approx(np.degrees(np.arcsin(found.up[2]))),
        'up_deviation': pytest.approx(np.degrees(found.up_std)), 'focal_length': found.focal,
        'focal_length_deviation': found.focal_std, 'directions': found.directions.tolist(),
        'reasons': list(found.reasons)}
    assert [arc['direction'] for arc in told['arcs']] == found.labels.tolist()
    rows = csv.DictReader((output / 'room.csv').open(newline=''))
    assert [int(row['direction']) for row in rows] == found.labels.tolist()
    plain = read_json(output / 'plain.json')
    assert plain['attitude']['up'] is None and plain['attitude']['directions'] == []
    assert 'arcs, must be at least 12' in plain['attitude']['reasons'][0]
    assert {arc['direction'] for arc in plain['arcs']} == {-1}

    assert main([inputs, '--output', str(tmp_path / 'off')]) == 0
    assert read_json(tmp_path / 'off' / 'room.json')['attitude'] is None
    assert 'direction' not in (tmp_path / 'off' / 'room.csv').read_text()


def test_horizon_and_axes_are_drawn_unless_unwanted(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / 'room.png'), Scene(640, 480, lam=-0.4).image(400))
    drawn = {}
    for name, flags in (('off', []), ('on', ['--attitude', 'true']),
                        ('bare', ['--attitude', 'true', '--draw_attitude', 'false'])):
        assert main([str(tmp_path / 'room.png'), *flags, '--output', str(tmp_path / name)]) == 0
        drawn[name] = cv2.imread(str(tmp_path / name / 'room.png'))
    np.testing.assert_array_equal(drawn['off'], drawn['bare'])
    yellow = (drawn['on'] == HORIZON).all(axis=2)
    assert yellow.any(axis=0).mean() > 0.5
    assert not (drawn['off'] == HORIZON).all(axis=2).any()


def test_a_focal_length_and_a_hint_that_are_given(tmp_path: Path) -> None:
    scene = Scene(640, 480, lam=-0.4)
    cv2.imwrite(str(tmp_path / 'room.png'), cv2.rotate(scene.image(400), cv2.ROTATE_180))
    assert main([str(tmp_path / 'room.png'), '--attitude', 'true', '--up_hint=+y', '--focal',
                 'fixed', '--focal_length', '360', '--output', str(tmp_path / 'out')]) == 0
    found = read_json(tmp_path / 'out' / 'room.json')['attitude']
    assert (found['focal_length'], found['focal_length_deviation']) == (360, 0)
    assert abs(found['roll']) == pytest.approx(180, abs=1)


def test_the_attitude_is_followed_over_a_video(tmp_path: Path) -> None:
    """As a tracker of its own for each video gives it, with one focal length for all frames."""
    scene, path = Scene(640, 480, lam=-0.6, colour=True), tmp_path / 'v.avi'
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*'MJPG'), 10, (640, 480))
    for number in range(600, 640, 8):
        writer.write(scene.image(number))
    writer.release()
    assert main([str(path), '--attitude', 'true', '--jobs', '2',
                 '--output', str(tmp_path / 'out')]) == 0
    capture, sequence, attitudes = cv2.VideoCapture(str(path)), FrameSequence(), AttitudeTracker()
    for number in range(5):
        gray = cv2.cvtColor(capture.read()[1], cv2.COLOR_BGR2GRAY)
        seen = sequence.find(gray, Parameters(), Settings())
        found = attitudes.add(seen.arcs, gray.shape, sequence.lens.estimate(Settings()))
        told = read_json(tmp_path / 'out' / 'v' / f'{number:06d}.json')
        assert told['attitude']['up'] == found.up.tolist()
        assert [arc['direction'] for arc in told['arcs']] == found.labels.tolist()
        assert np.degrees(np.arccos(found.up @ scene._camera(600 + 8 * number).axes[:, 2])) < 0.3
    assert told['attitude']['focal_length'] == pytest.approx(360, rel=0.02)
