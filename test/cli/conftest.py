"""A folder of pictures."""
from __future__ import annotations

from pathlib import Path

import cv2
from pictures import picture
import pytest


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with three images."""
    images = tmp_path / 'images'
    images.mkdir()
    for number in range(3):
        cv2.imwrite(str(images / f'{number}.png'), picture(number))
    return images
