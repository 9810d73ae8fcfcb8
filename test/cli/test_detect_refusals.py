"""What the command detect cannot read, do or write: it says which, and does the rest."""
from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys

import cv2
import numpy as np
from pictures import picture, write_video
import pytest
from qflsd_ros.cli.detect import main


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


def test_inputs_are_not_overwritten_by_frames(tmp_path: Path,
                                              capfd: pytest.CaptureFixture[str]) -> None:
    """Frames that somebody has taken out of a video lie where its results would."""
    video = write_video(tmp_path / 'v.avi', map(picture, range(2)))
    (tmp_path / 'v').mkdir()
    cv2.imwrite(str(tmp_path / 'v' / '000000.png'), picture(7))
    assert main([str(video), str(tmp_path / 'v'), '--output', str(tmp_path)]) == 2
    assert "v/000000.png' would be overwritten" in capfd.readouterr().err
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / 'v' / '000000.png')), picture(7))
