"""The attitude in the results of the command detect."""
from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np
from pictures import picture, read_json, write_video
import pytest
from qflsd_ros.attitude_drawing import HORIZON
from qflsd_ros.cli.detect import main
from qflsd_ros.core import (
    AttitudeTracker, Detector, estimate_attitude, estimate_distortion, Parameters)
from qflsd_ros.ros.finding import FrameSequence
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources import Scene


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
    scene = Scene(640, 480, lam=-0.6, colour=True)
    path = write_video(tmp_path / 'v.avi', map(scene.image, range(600, 640, 8)))
    assert main([str(path), '--attitude', 'true', '--output', str(tmp_path / 'out')]) == 0
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
