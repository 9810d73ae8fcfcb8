"""Which pictures the arguments of the command line stand for, and what they are called."""
from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
from hypothesis import given, strategies as st
import numpy as np
from pictures import write_video
import pytest
from qflsd_ros.cli import inputs
from qflsd_ros.sources.frames import SourceError


def touch(root: Path, *names: str) -> list[Path]:
    """Make empty files."""
    paths = [root / name for name in names]
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return paths


def fail(text: str) -> None:
    """Take reports where there must be none."""
    pytest.fail(text)


def brighter(frames: int) -> Iterator[np.ndarray]:
    """Yield small frames that grow brighter."""
    for number in range(frames):
        yield np.full((48, 64, 3), 5 * number, np.uint8)


def test_folders_give_images_and_videos_in_order(tmp_path: Path) -> None:
    """A folder stands for its images and videos, in natural order; other files are left."""
    touch(tmp_path, 'b10.PNG', 'b9.jpg', 'c.avi', 'notes.txt', 'deeper/d.png')
    files, missing = inputs.find([str(tmp_path)])
    assert [path.name for path in files] == ['b9.jpg', 'b10.PNG', 'c.avi']
    assert missing == []


def test_globs_are_expanded(tmp_path: Path) -> None:
    """A pattern that no shell has expanded is expanded, ** through all folders."""
    touch(tmp_path, 'a.png', 'b.png', 'c.jpg', 'deeper/d.png')
    assert [p.name for p in inputs.find([f'{tmp_path}/*.png'])[0]] == ['a.png', 'b.png']
    deep = inputs.find([f'{tmp_path}/**/*.png'])[0]
    assert sorted(path.name for path in deep) == ['a.png', 'b.png', 'd.png']


def test_a_file_with_the_signs_of_a_pattern_is_that_file(tmp_path: Path) -> None:
    """What exists under its literal name is not taken for a pattern."""
    touch(tmp_path, 'a[1].png', 'a1.png')
    assert [p.name for p in inputs.find([f'{tmp_path}/a[1].png'])[0]] == ['a[1].png']


def test_files_named_twice_count_once_and_missing_ones_are_told(tmp_path: Path) -> None:
    """The same file through two arguments is one file."""
    touch(tmp_path, 'a.png')
    files, missing = inputs.find([f'{tmp_path}/a.png', str(tmp_path), f'{tmp_path}/x*.png', 'no'])
    assert [path.name for path in files] == ['a.png']
    assert missing == [f'{argument!r}: no such file, and no file matches it'
                       for argument in (f'{tmp_path}/x*.png', 'no')]


def test_names_are_short_where_they_can_be(tmp_path: Path) -> None:
    """A name alone where it is the only one, with its folder or suffix where it is not."""
    files = touch(tmp_path, 'left/1.png', 'right/1.png', 'right/2.png', '3.png', '3.jpg')
    assert inputs.names(files) == ['left_1', 'right_1', '2', '3.png', '3.jpg']


def test_names_that_differ_in_capitals_alone_are_alike(tmp_path: Path) -> None:
    """And in how their accents are written."""
    files = touch(tmp_path, 'A.png', 'a.png', 'A.jpg', 'e\u0301.png', '\u00e9.jpg', 'b.png')
    assert inputs.names(files) == ['A.png', 'a.png_2', 'A.jpg', 'e\u0301.png', '\u00e9.jpg', 'b']


@given(st.lists(st.tuples(st.sampled_from(['', 'a', 'b', 'a_b', 'a/b', 'b/a']),
                          st.sampled_from(['a', 'b', 'A', 'a_b', 'A_b', 'a.png', 'b_2', 'a_b_2']),
                          st.sampled_from(['.png', '.jpg', '.PNG'])), unique=True))
def test_no_two_names_are_alike(paths: list[tuple[str, str, str]]) -> None:
    """Whatever the files are called and wherever they lie, no result overwrites another."""
    files = [Path('/data', folder, stem + suffix) for folder, stem, suffix in paths]
    names = inputs.names(files)
    assert len({name.lower() for name in names}) == len(files)  # a disk may tell no capitals
    assert not any('/' in name for name in names)


def test_reading_keeps_colours_and_ignores_orientation(tmp_path: Path) -> None:
    """An image comes as B, G, R."""
    pixels = np.random.default_rng(0).integers(0, 255, (20, 30, 3), np.uint8)
    cv2.imwrite(str(tmp_path / 'a.png'), pixels)
    [picture] = inputs.pictures(tmp_path / 'a.png', 'a', '', fail, fail)
    np.testing.assert_array_equal(picture.read(), pixels)
    assert picture.frame is None


def test_videos_give_numbered_frames(tmp_path: Path) -> None:
    """Every frame of a video is a picture of its own, in order."""
    write_video(tmp_path / 'v.avi', brighter(5))
    frames = list(inputs.pictures(tmp_path / 'v.avi', 'v', '', fail, fail))
    assert [frame.name for frame in frames] == [f'v/{number:06d}' for number in range(5)]
    assert [frame.frame for frame in frames] == list(range(5))
    brightness = [frame.read().mean() for frame in frames]
    assert brightness == sorted(brightness) and brightness[4] > 10
    assert inputs.count(tmp_path / 'v.avi', '') == 5


def test_a_video_cut_short_gives_what_it_has_and_a_report(tmp_path: Path) -> None:
    """The frames before the damage are there; that some are missing is said."""
    path = tmp_path / 'v.avi'
    write_video(path, brighter(50))
    path.write_bytes(path.read_bytes()[:path.stat().st_size // 2])
    reports: list[str] = []
    assert 0 < len(list(inputs.pictures(path, 'v', '', reports.append, fail))) < 50
    assert len(reports) == 1 and 'v.avi' in reports[0]


def test_a_broken_video_is_named(tmp_path: Path) -> None:
    """What is no video ends in an error that names the file."""
    [path] = touch(tmp_path, 'v.mp4')
    with pytest.raises(SourceError, match='v.mp4'):
        list(inputs.pictures(path, 'v', '', fail, fail))
