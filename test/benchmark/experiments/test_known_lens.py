"""What a known lens is worth: worked by hand, and on images so small that they say nothing."""
from __future__ import annotations

from pathlib import Path

from benchmark.datasets import View
from benchmark.experiments import known_lens
from benchmark.scenes.rendered import room, sagitta
import cv2
import numpy as np
import pytest
from qflsd_ros.core import Arcs, DivisionModel
from qflsd_ros.core.arcs import TABLE

# Half its diagonal is 500 px, its centre (399.5, 299.5).
LENS = DivisionModel(-0.5, (600, 800))


def test_errors_of_the_sagitta() -> None:
    """
    What lies 100 px above the centre is bent by 2 * 0.5 * 0.2 / (1 + 0.5 * 0.04) / 500 px.

    It has its centre below: travel to the right turns to the y axis.
    """
    bend = 0.2 / 1.02 / 500
    table = np.zeros(5, TABLE)
    table['length'] = 40, 60, 60, 60, 80
    table['middle'] = 399.5, 199.5
    table['start'], table['end'] = (370, 199.5), (430, 199.5)
    table['start'][2], table['end'][2] = (430, 199.5), (370, 199.5)
    table['middle'][3] = 399.5, 299.5       # through the centre: straight
    table['curvature'] = bend, 0, bend, 1e-3, 1
    arcs = Arcs(table, np.zeros((0, 2)), np.zeros((0, 2), np.int32), np.zeros(6, np.int64))
    assert known_lens.sagitta_errors(arcs, LENS) == pytest.approx(
        [0, bend * 450, 2 * bend * 450, 0.45])


@pytest.fixture
def view(tmp_path: Path) -> View:
    """Return a frame of the room through a lens, with its lines."""
    picture = room(0, -0.5, (240, 320))
    path = tmp_path / 'room.png'
    cv2.imwrite(str(path), picture.gray)
    sagittas = np.array([sagitta(line) for line in picture.lines])
    return View('wide', path, picture.lines, sagittas, 'wide')


def test_an_image_that_tells_its_lens(view: View) -> None:
    """The same lines are counted twice, on other arcs, and both runs took their time."""
    used = known_lens.use(view)
    unknown, known = used.unknown.every, used.known.every
    assert unknown.lines == known.lines > used.known.curved.lines > 5
    assert unknown.covered > 0.5 * unknown.truth
    assert known != unknown and known.covered > 0.95 * unknown.covered
    assert used.seconds > 0 and used.seconds_known > 0


def test_an_image_that_does_not(view: View) -> None:
    """It goes without, and its time does not count."""
    cv2.imwrite(str(view.path), np.zeros((240, 320), np.uint8))
    used = known_lens.use(view)
    assert used.unknown == used.known and used.unknown.every.lines > 20
    assert used.unknown.every.covered == used.seconds == used.seconds_known == 0
