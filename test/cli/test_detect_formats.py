"""Formats of image files that the command detect reads, and their white levels."""
from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
from pictures import check_csv, picture
import pytest
from qflsd_ros.cli.detect import main
from qflsd_ros.core import Detector


@pytest.mark.parametrize('suffix', ['.jfif', '.jpe', '.pbm', '.pnm', '.dib'])
def test_every_suffix_of_a_format_that_is_read_is_that_of_an_image(
        tmp_path: Path, suffix: str) -> None:
    pixels = np.full((60, 80), 255, np.uint8)
    pixels[20:40, 20:60] = 0
    form = '.jpg' if suffix == '.jfif' else suffix
    (tmp_path / f'a{suffix}').write_bytes(cv2.imencode(form, pixels)[1].tobytes())
    for number, argument in enumerate((tmp_path, tmp_path / f'a{suffix}')):
        output = tmp_path / str(number)
        assert main([str(argument), '--output', str(output)]) == 0
        assert len(json.loads((output / 'a.json').read_text())['arcs']) == 4


def ten_bits() -> np.ndarray:
    """Return a picture of 10 bits, (150, 200) uint16."""
    return picture(0)[..., 0] * np.uint16(4)


@pytest.mark.parametrize('white, arcs', [('1023', 4), ('0', 0)])
def test_white_level(tmp_path: Path, white: str, arcs: int) -> None:
    """A PNG does not say that its 16 bits hold 10."""
    cv2.imwrite(str(tmp_path / 'a.png'), ten_bits())
    assert main([str(tmp_path / 'a.png'), '--white_level', white, '--output',
                 str(tmp_path / 'out')]) == 0
    found = json.loads((tmp_path / 'out' / 'a.json').read_text())
    # As 16 bits, the whole picture spans 4 grey levels.
    assert len(found['arcs']) >= arcs
    assert all((arc['contrast'] > 10) == bool(arcs) for arc in found['arcs'])
    drawn = cv2.imread(str(tmp_path / 'out' / 'a.png'))
    assert (drawn.max() > 200) == bool(arcs)


@pytest.mark.parametrize('head', [b'P5 200 150 1023\n', b'P5\n# 9\n200 150\n#7\n1023\n'])
def test_white_of_a_pgm_is_what_it_says(tmp_path: Path, head: bytes) -> None:
    (tmp_path / 'a.pgm').write_bytes(head + ten_bits().astype('>u2').tobytes())
    assert main([str(tmp_path / 'a.pgm'), '--output', str(tmp_path / 'out')]) == 0
    gray = cv2.convertScaleAbs(ten_bits(), alpha=255 / 1023)
    check_csv(tmp_path / 'out' / 'a.csv', Detector().detect(gray))
