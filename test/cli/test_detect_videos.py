"""The command detect on videos: numbered frames; lens and tracks go on from frame to frame."""
from __future__ import annotations

import csv
import json
from pathlib import Path

import cv2
import numpy as np
from pictures import picture, write_video
import pytest
from qflsd_ros.cli.detect import main
from qflsd_ros.core import Tracker
from qflsd_ros.sources import Scene


def test_frames_of_a_video_are_numbered(tmp_path: Path) -> None:
    """A video gives a folder of its own with the results of each frame."""
    path = write_video(tmp_path / 'v.avi', map(picture, range(3)))
    assert main([str(path), '--output', str(tmp_path / 'results')]) == 0
    assert len(list((tmp_path / 'results' / 'v').iterdir())) == 9
    found = json.loads((tmp_path / 'results' / 'v' / '000002.json').read_text())
    assert found['frame'] == 2 and len(found['arcs']) >= 4


def test_a_lens_is_followed_from_frame_to_frame_of_a_video_alone(tmp_path: Path) -> None:
    """A dull frame knows the lens by those before it; a dull image file does not."""
    room = cv2.cvtColor(Scene(640, 480, lam=-0.4).image(400), cv2.COLOR_GRAY2BGR)
    dull = np.full_like(room, 90)
    write_video(tmp_path / 'v.avi', [room, dull])
    write_video(tmp_path / 'w.avi', [dull, dull])
    cv2.imwrite(str(tmp_path / 'x.png'), dull)
    for jobs in ('1', '2'):
        output = tmp_path / jobs
        assert main([*(str(tmp_path / name) for name in ('v.avi', 'w.avi', 'x.png')),
                     '--output', str(output), '--jobs', jobs]) == 0
        lenses = [json.loads((output / f'{name}.json').read_text())['lens']
                  for name in ('v/000000', 'v/000001', 'w/000000', 'w/000001', 'x')]
        assert [lens['lambda'] for lens in lenses[:2]] == pytest.approx([-0.4, -0.4], abs=0.03)
        assert lenses[2:] == [None] * 3


def test_lines_of_a_video_keep_their_tracks_and_images_have_none(tmp_path: Path) -> None:
    """As a tracker of its own for each video gives them, whoever draws the frames."""
    scene = Scene(320, 240, lam=-0.3, colour=True)
    frames = [scene.image(400 + number) for number in range(6)]
    videos = [str(write_video(tmp_path / f'{name}.avi', frames)) for name in 'ab']
    cv2.imwrite(str(tmp_path / 'photo.png'), frames[0])
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
