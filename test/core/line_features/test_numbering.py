"""Numbers of lines are unbroken, exact in float32, and different for each camera."""
from __future__ import annotations

import numpy as np
import pytest
from qflsd_ros.core.line_features.numbering import LARGEST, Numbering


def take(numbering: Numbering, *tracks: int, cameras: int = 1, camera: int = 0) -> list[int]:
    return numbering.take(np.array(tracks, np.uint32), cameras, camera).tolist()


def test_a_line_keeps_its_number_and_one_that_returns_gets_another():
    numbering = Numbering()
    assert take(numbering, 70, 80, 90) == [1, 2, 3]
    assert take(numbering, 90, 70) == [3, 1]
    assert sorted(numbering.tracks.tolist()) == [70, 90]
    assert take(numbering, 80, 90) == [4, 3]
    assert take(numbering) == []
    assert take(numbering, 90) == [5]


@pytest.mark.parametrize('cameras', [1, 2, 16])
def test_readers_decode_line_and_camera_and_no_two_cameras_share_a_line(cameras):
    lines = []
    for camera in range(cameras):
        numbering = Numbering()
        for tracks in ((1, 2, 3), (2, 5), (5, 9)):
            for value in np.array(take(numbering, *tracks, cameras=cameras, camera=camera),
                                  np.float32):
                number = int(float(value) + 0.5)
                assert number % cameras == camera
                lines.append((number // cameras, camera))
    assert len({line for line, _ in lines}) == len(set(lines))


@pytest.mark.parametrize('cameras', [1, 2, 16])
def test_numbers_below_2_to_the_24_begin_anew_and_leave_out_what_is_in_use(cameras):
    numbering = Numbering()
    first = take(numbering, 1, 2, cameras=cameras, camera=cameras - 1)
    numbering._next = LARGEST // cameras ** 2 - 2
    found = [take(numbering, 2, track, cameras=cameras, camera=cameras - 1)
             for track in range(10, 15)]
    assert {numbers[0] for numbers in found} == {first[1]}
    fresh = [numbers[1] for numbers in found]
    assert len(set(fresh)) == 5 and first[1] not in fresh
    assert max(fresh) < LARGEST and int(np.float32(max(fresh))) == max(fresh)
    assert min(fresh) == first[0]


def test_more_cameras_than_before():
    numbering = Numbering()
    numbering._next = LARGEST - 10      # as after days
    before = take(numbering, 1, 2)
    after = take(numbering, 1, 2, cameras=16, camera=3)
    assert len(set(after)) == 2 and max(after) < LARGEST and before != after
    assert all(number % 16 == 3 for number in after)
