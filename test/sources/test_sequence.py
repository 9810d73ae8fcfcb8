"""A folder with sequence.json: images with stamps, poses and a calibration."""
from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from qflsd_ros.sources import open_source, SourceError

POSE = [[0.0, 0, 1, 0.5], [-1, 0, 0, 2], [0, -1, 0, 1.5], [0, 0, 0, 1]]
FRAME = {'image': 'b.png', 'stamp': 1311868169.25, 'pose': POSE}
CONTENT: dict[str, Any] = {
    'K': [[20.0, 0, 4], [0, 21, 3], [0, 0, 1]], 'distortion': [0.1, -0.2, 0.001, 0],
    'frames': [FRAME, {'image': 'a.png', 'stamp': 1311868169.5, 'pose': POSE, 'depth': 'c.png'}]}


def write(folder: Path, content: Any) -> str:
    for name in 'abc':
        cv2.imwrite(str(folder / f'{name}.png'), np.full((6, 8, 3), ord(name), np.uint8))
    (folder / 'sequence.json').write_text(
        content if isinstance(content, str) else json.dumps(content))
    return str(folder)


def test_frames_are_those_of_the_file_in_its_order(tmp_path):
    source = open_source(write(tmp_path, CONTENT))
    for _ in range(2):
        frames = list(source)
        assert [frame.name for frame in frames] == ['b.png', 'a.png']
        assert [frame.data[0] for frame in frames] == [ord('b'), ord('a')]
    assert [frame.stamp for frame in frames] == [1311868169_250000000, 1311868169_500000000]
    assert [frame.recorded for frame in frames] == [frame.stamp for frame in frames]
    assert all(np.array_equal(frame.pose, POSE) for frame in frames)
    assert source.posed and not source.live and not source.on_demand


def test_calibration_is_plumb_bob_unless_it_is_named(tmp_path):
    camera = open_source(write(tmp_path, CONTENT)).camera
    assert camera.model == 'plumb_bob' and camera.matrix.tolist() == CONTENT['K']
    assert camera.coefficients[:5].tolist() == [0.1, -0.2, 0.001, 0, 0]
    plain = {name: value for name, value in CONTENT.items() if name != 'distortion'}
    assert not open_source(write(tmp_path, plain)).camera.coefficients.any()
    fisheye = open_source(write(tmp_path, CONTENT | {'distortion_model': 'equidistant'})).camera
    assert fisheye.model == 'equidistant'


def test_colour(tmp_path):
    assert next(iter(open_source(write(tmp_path, CONTENT), colour=True))).encoding == 'bgr8'


def test_image_that_cannot_be_read_is_skipped_once(tmp_path):
    reports: list[str] = []
    folder = write(tmp_path, CONTENT)
    (tmp_path / 'b.png').unlink()
    source = open_source(folder, report=reports.append)
    assert [frame.name for _ in range(2) for frame in source] == ['a.png', 'a.png']
    assert len(reports) == 1 and 'b.png' in reports[0]


def test_a_folder_without_the_file_has_no_poses(tmp_path):
    write(tmp_path, CONTENT)
    (tmp_path / 'sequence.json').unlink()
    source = open_source(str(tmp_path))
    assert not source.posed and source.camera is None
    assert [frame.pose for frame in source] == [None] * 3


@pytest.mark.parametrize(('changes', 'text'), [
    ({'K': None}, 'K must be 3 x 3 numbers'),
    ({'K': [[1, 2], [3, 4]]}, 'K must be 3 x 3 numbers'),
    ({'K': np.zeros((3, 3)).tolist()}, 'camera matrix K has no focal length above 0'),
    ({'distortion': 'none'}, 'distortion must be N numbers'),
    ({'distortion': [0.1] * 6}, 'at most 5'),
    ({'distortion_model': 'fov'}, "distortion model is 'fov': must be one of plumb_bob"),
    ({'frames': []}, 'frames must be a list of at least one frame'),
    ({'frames': {}}, 'frames must be a list'),
    ({'frames': [FRAME, 7]}, 'frame 1: must be an object with image'),
    ({'frames': [FRAME | {'image': 7}]}, 'frame 0: image must be the name of a file'),
    ({'frames': [FRAME | {'stamp': 'now'}]}, 'frame 0: stamp must be a number'),
    ({'frames': [FRAME | {'stamp': -1}]}, 'frame 0: stamp is -1: must lie in 0 to 2147483647 s'),
    ({'frames': [FRAME | {'stamp': 1e12}]}, 'must lie in 0 to'),
    ({'frames': [FRAME | {'pose': POSE[:3]}]}, 'frame 0: pose must be 4 x 4 numbers'),
    ({'frames': [FRAME | {'pose': (2 * np.eye(4)).tolist()}]}, 'frame 0: pose must be a rotation'),
    ({'frames': [FRAME | {'pose': np.diag([1, 1, -1, 1]).tolist()}]}, 'must be a rotation'),
    ({'frames': [{'image': 'a.png', 'stamp': 0}]}, 'frame 0: pose is missing')])
def test_what_cannot_be_used_is_named(tmp_path, changes, text):
    with pytest.raises(SourceError, match=text) as caught:
        open_source(write(tmp_path, CONTENT | changes))
    assert 'sequence.json' in str(caught.value) and '\n' not in str(caught.value)


@pytest.mark.parametrize('text', ['', '{', '[]', '7', 'null', '[' * 100000, '\0', '{"K": NaN}',
                                  '{"K": [[1e999, 0, 0], [0, 1, 0], [0, 0, 1]]}'])
def test_text_that_is_no_description_is_refused(tmp_path, text):
    with pytest.raises(SourceError, match='sequence.json'):
        open_source(write(tmp_path, text))
