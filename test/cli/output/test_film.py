"""Pictures become a video at the pace at which they came."""
from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from qflsd_ros.cli.output import film
from qflsd_ros.cli.output.film import Film


def flat(level: int, size: tuple[int, int] = (64, 48)) -> np.ndarray:
    return np.full((size[1], size[0], 3), level, np.uint8)


def levels(path: Path) -> list[int]:
    """Return the mean grey level of each frame of a video of 64 x 48 px."""
    capture, found = cv2.VideoCapture(str(path)), []
    while (pixels := capture.read()[1]) is not None:
        assert pixels.shape == (48, 64, 3)
        found.append(int(pixels.mean()))
    return found


def test_a_picture_stays_until_the_next_one(tmp_path: Path,
                                            monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(film.time, 'monotonic', lambda: now[0])
    path = tmp_path / 'new' / 'a.mp4'
    with Film(path) as video:
        for level, seconds in ((20, 1.0), (120, 0.5), (220, 0.5)):
            # One picture of another size, as a folder may hold.
            video.show(flat(level, (80, 60) if level == 120 else (64, 48)))
            now[0] += seconds
    found = levels(path)
    assert [sum(abs(one - level) < 8 for one in found) for level in (20, 120, 220)] \
        == [30, 15, 15]
    assert [file.name for file in path.parent.iterdir()] == ['a.mp4']


def test_without_a_picture_there_is_no_file(tmp_path: Path) -> None:
    with Film(tmp_path / 'a.mp4'):
        pass
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / 'a.mp4').mkdir()
    with pytest.raises(OSError, match='a.mp4'):
        with Film(tmp_path / 'a.mp4') as video:
            video.show(flat(20))
    assert [path.name for path in tmp_path.iterdir()] == ['a.mp4']


def test_planted_links_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / 'victim').write_text('mine')
    for name in ('a.mp4', '.a.part.mp4'):
        (tmp_path / name).symlink_to(tmp_path / 'victim')
    with Film(tmp_path / 'a.mp4') as video:
        video.show(flat(20))
    assert (tmp_path / 'victim').read_text() == 'mine'
    assert not (tmp_path / 'a.mp4').is_symlink()
