"""Images, folders and videos as sources."""
from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from qflsd_ros.sources import Frame, open_source, SourceError


def picture(seed: int, shape: tuple[int, int] = (24, 32)) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (*shape, 3), np.uint8)


def write(path: Path, image: np.ndarray) -> Path:
    path.write_bytes(cv2.imencode(path.suffix, image)[1].tobytes())
    return path


def write_video(path: Path, count: int, detail: int = 0) -> Path:
    """Write a video whose frames get brighter; ``detail`` makes their files larger."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*'MJPG'), 25, (64, 48))
    for number in range(count):
        grain = picture(number, (48, 64)) % (detail + 1)
        writer.write(np.full((48, 64, 3), 10 * number, np.uint8) + grain)
    writer.release()
    return path


def pixels(frame: Frame) -> np.ndarray:
    return np.frombuffer(frame.data, np.uint8).reshape(frame.height, frame.step)


def test_image(tmp_path):
    image = picture(0)
    source = open_source(str(write(tmp_path / 'a.png', image)), colour=True)
    for _ in range(2):
        frame, = source
        assert (frame.width, frame.height, frame.step, frame.encoding) == (32, 24, 96, 'bgr8')
        assert np.array_equal(pixels(frame), image.reshape(24, 96))
    assert (frame.name, frame.stamp, frame.frame_id) == ('a.png', None, None)


def test_grey_image(tmp_path):
    image = picture(0)
    frame, = open_source(str(write(tmp_path / 'a.png', image)))
    assert (frame.step, frame.encoding) == (32, 'mono8')
    assert cv2.absdiff(pixels(frame), cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)).max() <= 1


def test_folder_comes_in_natural_order(tmp_path):
    for name in ('frame10.png', 'frame2.png', 'Frame1.JPG', 'frame2.png.txt', 'notes.md', '7.bmp'):
        write(tmp_path / name, picture(1)) if name[-1] not in 'td' else (
            tmp_path / name).write_text('no image')
    names = [frame.name for frame in open_source(str(tmp_path))]
    assert names == ['7.bmp', 'Frame1.JPG', 'frame2.png', 'frame10.png']


def test_what_is_unreadable_in_a_folder_is_reported_once_skipped_and_counted(tmp_path):
    good = write(tmp_path / '1.png', picture(1))
    (tmp_path / '2.png').write_bytes(good.read_bytes()[:200])
    (tmp_path / '3.jpg').write_bytes(b'')
    (tmp_path / '4.png').symlink_to(tmp_path / '4.png')
    write(tmp_path / '5.png', picture(2))
    reports: list[str] = []
    source = open_source(str(tmp_path), report=reports.append)
    for _ in range(2):
        assert [frame.name for frame in source] == ['1.png', '5.png']
        assert source.skipped == len(reports) == 3
    assert all(name in report for name, report in zip(('2.png', '3.jpg', '4.png'), reports))
    assert all('\n' not in report for report in reports)


def test_folder_with_nothing_readable_in_it(tmp_path):
    (tmp_path / '1.png').write_bytes(b'no image')
    source = open_source(str(tmp_path), report=lambda _: None)
    with pytest.raises(SourceError, match='not one frame'):
        list(source)


def test_video(tmp_path):
    source = open_source(str(write_video(tmp_path / 'a.avi', 12)))
    for _ in range(2):
        frames = list(source)
        assert len(frames) == 12 and source.skipped == 0
        levels = [pixels(frame).mean() for frame in frames]
        assert levels == pytest.approx(range(0, 120, 10), abs=3)
    assert (frames[0].width, frames[0].height, frames[0].encoding) == (64, 48, 'mono8')
    assert frames[3].name == 'frame 3'


def test_video_in_colour(tmp_path):
    frame = next(iter(open_source(str(write_video(tmp_path / 'a.avi', 2)), colour=True)))
    assert (frame.step, frame.encoding) == (192, 'bgr8')


def test_truncated_video_gives_what_there_is_and_says_so(tmp_path):
    whole = write_video(tmp_path / 'a.avi', 20, detail=60).read_bytes()
    cut = tmp_path / 'cut.avi'
    cut.write_bytes(whole[:len(whole) // 2])
    reports: list[str] = []
    source = open_source(str(cut), report=reports.append)
    count = len(list(source))
    assert 2 < count < 20
    assert len(reports) == 1 and f'after {count} frames of 20' in reports[0]


@pytest.mark.parametrize(('name', 'content', 'what'), [
    ('a.png', b'no image', 'no image that can be read'),
    ('a.jpg', b'', 'no image that can be read'),
    ('a.avi', b'no video', 'no video that can be read'),
    ('a.mp4', b'', 'no video that can be read'),
    ('new\nline.png', b'', 'no image that can be read'),
    ('notes.txt', b'hello', 'no video that can be read')])
def test_unreadable_file(tmp_path, name, content, what):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SourceError, match=what) as error:
        open_source(str(tmp_path / name))
    assert '\n' not in str(error.value) and name.split('\n')[0] in str(error.value)


def test_an_image_that_claims_gigabytes(tmp_path):
    data = bytearray(cv2.imencode('.png', picture(0))[1].tobytes())
    data[16:24] = (20000).to_bytes(4, 'big') * 2
    (tmp_path / 'huge.png').write_bytes(data)
    with pytest.raises(SourceError, match='huge.png.*: has 20000 x 20000 pixels'):
        open_source(str(tmp_path / 'huge.png'))


@pytest.mark.parametrize('name', ['pipe', 'pipe.png', 'pipe.mp4', 'pipe.mcap'])
def test_a_pipe_is_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(SourceError, match=name):
        open_source(str(tmp_path / name))


def test_missing_source(tmp_path):
    with pytest.raises(SourceError, match='gone.png.* is not there: must be an image'):
        open_source(str(tmp_path / 'gone.png'))


def test_symlink_to_itself(tmp_path):
    (tmp_path / 'loop').symlink_to(tmp_path / 'loop')
    with pytest.raises(SourceError, match='loop'):
        open_source(str(tmp_path / 'loop'))


def test_empty_folder(tmp_path):
    with pytest.raises(SourceError, match='no image in this folder: its files must end in .bmp'):
        open_source(str(tmp_path))


def test_missing_webcam():
    with pytest.raises(SourceError, match='^webcam 63: cannot be opened: it is not there'):
        open_source('63')


def test_frame_of_sixteen_bits():
    frame = Frame.of(np.zeros((3, 5), np.uint16), 'mono16', 'x')
    assert (frame.step, len(frame.data), frame.is_bigendian) == (10, 30, False)
