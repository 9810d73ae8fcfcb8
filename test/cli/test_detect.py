"""The command detect on image files: what it writes, and the settings that it follows."""
from __future__ import annotations

import csv
import json
from pathlib import Path
import subprocess
import sys

import cv2
import numpy as np
from pictures import check_csv, expected, picture
import pytest
from qflsd_ros import overlay
from qflsd_ros.cli.detect import main
from qflsd_ros.cli.settings import Options
from qflsd_ros.core import Arcs, Parameters
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources import Scene


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
