"""Region, mask and scale give one array and one factor for each size of images."""
from __future__ import annotations

import os
from pathlib import Path
import struct

import cv2
from hypothesis import given, strategies as st
import numpy as np
import pytest
from qflsd_ros.core import Detector, Parameters
from qflsd_ros.ros.input.region import read_mask, reduced, View, view, ViewError
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources import SourceError
from scenery import scene
from soundness import assert_within


def write_mask(folder: Path, black: tuple[slice, slice], shape: tuple[int, int]) -> str:
    pixels = np.full(shape, 255, np.uint8)
    pixels[black] = 0
    cv2.imwrite(str(folder / 'mask.png'), pixels)
    return str(folder / 'mask.png')


def test_by_default_the_whole_image_is_looked_at_as_it_is() -> None:
    assert view(Settings(), 480, 640) == View(1, None)
    assert view(Settings(max_width=640), 480, 640) == View(1, None)


def test_a_region_is_all_that_is_looked_at() -> None:
    mask = view(Settings(roi_x=10, roi_y=20, roi_width=30, roi_height=5), 100, 200).mask
    assert mask is not None and mask.shape == (100, 200)
    assert mask[20:25, 10:40].all() and mask.sum() == 5 * 30


@pytest.mark.parametrize('changes, area', [
    ({'roi_x': 150}, 100 * 50), ({'roi_y': 40}, 60 * 200), ({'roi_width': 7}, 100 * 7),
    ({'roi_x': 190, 'roi_width': 500}, 100 * 10)])
def test_a_region_goes_on_to_the_rim(changes: dict[str, int], area: int) -> None:
    mask = view(Settings(**changes), 100, 200).mask
    assert mask is not None and mask.sum() == area


def test_mask_and_region_both_hold(tmp_path: Path) -> None:
    path = write_mask(tmp_path, np.s_[:50, :], (100, 200))
    mask = view(Settings(mask=path, roi_width=20), 100, 200).mask
    assert mask is not None and mask[50:, :20].all() and mask.sum() == 50 * 20


def test_the_mask_shrinks_with_the_image_and_keeps_what_it_covers(tmp_path: Path) -> None:
    path = write_mask(tmp_path, np.s_[:, 90:91], (100, 201))
    factor, mask = view(Settings(mask=path, max_width=50), 100, 201)
    assert factor == 5 and mask is not None and mask.shape == (20, 40)
    assert np.flatnonzero(~mask.all(axis=0)).tolist() == [18]


@pytest.mark.parametrize('width, height, limit, factor', [
    (640, 480, 320, 2), (641, 480, 320, 3), (640, 480, 639, 2), (640, 2, 10, 2), (1, 1, 1, 1)])
def test_factor(width: int, height: int, limit: int, factor: int) -> None:
    assert view(Settings(max_width=limit), height, width).factor == factor


@pytest.mark.parametrize('factor', [1, 2, 3])
def test_reduced_gives_means_of_blocks(factor: int) -> None:
    pixels = np.random.default_rng(0).integers(0, 255, (31, 47), np.uint8)
    small = reduced(pixels[:, ::1], factor)
    height, width = 31 // factor, 47 // factor
    blocks = pixels[:height * factor, :width * factor].reshape(height, factor, width, factor)
    assert small.shape == (height, width)
    assert np.abs(small - blocks.mean(axis=(1, 3))).max() <= 0.5 + 1e-9


@pytest.mark.parametrize('changes, reason, texts', [
    ({'roi_x': 200}, 'region outside', ['roi_x 200', '200 x 100']),
    ({'roi_y': 100}, 'region outside', ['roi_y 100']),
])
def test_what_does_not_fit_is_named(changes: dict, reason: str, texts: list[str]) -> None:
    with pytest.raises(ViewError) as caught:
        view(Settings(**changes), 100, 200)
    assert caught.value.reason == reason
    assert all(text in str(caught.value) for text in texts), str(caught.value)


def made(folder: Path, kind: str) -> Path:
    """Make a file that is not a mask."""
    path = folder / kind
    if kind == 'pipe':
        os.mkfifo(path)
    elif kind == 'huge':
        with path.open('wb') as file:
            file.truncate(1 << 40)
    elif kind == 'text':
        path.write_text('no image')
    return path


@pytest.mark.parametrize('kind, text', [
    ('/dev/zero', 'is no file'), ('/dev/null', 'is no file'), ('pipe', 'is no file'),
    ('', 'is no file'), ('huge', 'must have at most'), ('nowhere', 'No such file'),
    ('text', 'no image that can be read'), ('/proc/kmsg', '/proc/kmsg')])
def test_what_is_no_image_file_is_named_at_once(tmp_path: Path, kind: str, text: str) -> None:
    """Pipes and devices would give bytes without end, or never any."""
    path = made(tmp_path, kind)
    with pytest.raises(SourceError, match=text) as caught:
        read_mask(str(path))
    assert repr(str(path)) in str(caught.value)


def test_a_mask_has_the_orientation_of_the_sensor(tmp_path: Path) -> None:
    """An orientation tag turns neither masks nor images."""
    pixels = np.zeros((10, 20), np.uint8)
    pixels[:, 10:] = 255
    jpeg = cv2.imencode('.jpg', pixels)[1].tobytes()
    tag = struct.pack('>2sHIHHHIHHI', b'MM', 42, 8, 1, 0x112, 3, 1, 6, 0, 0)  # a quarter turn
    exif = b'\xff\xe1' + struct.pack('>H', 8 + len(tag)) + b'Exif\0\0' + tag
    path = tmp_path / 'turned.jpg'
    path.write_bytes(jpeg[:2] + exif + jpeg[2:])
    assert cv2.imread(str(path), cv2.IMREAD_GRAYSCALE).shape == (20, 10)
    assert np.array_equal(read_mask(str(path)), pixels > 127)


def test_a_mask_of_another_size_is_named(tmp_path: Path) -> None:
    path = write_mask(tmp_path, np.s_[:, :9], (10, 20))
    with pytest.raises(ViewError, match='has 20 x 10 pixels: must have 200 x 100'):
        view(Settings(mask=path), 100, 200)


def test_the_file_is_read_once(tmp_path: Path) -> None:
    path = write_mask(tmp_path, np.s_[:, :9], (10, 20))
    first = read_mask(path)
    Path(path).unlink()
    assert read_mask(path) is first


@given(st.integers(0, 20), st.integers(0, 100), st.integers(0, 80), st.integers(20, 140),
       st.integers(20, 100), st.sampled_from([0, 80]))
def test_no_arc_leaves_the_region_of_the_node(seed, x, y, width, height, max_width):
    gray = scene(seed)
    settings = Settings(roi_x=x, roi_y=y, roi_width=width, roi_height=height,
                        max_width=max_width)
    factor, mask = view(settings, *gray.shape)
    arcs = Detector(Parameters(min_score=-1000.0)).detect(reduced(gray, factor), mask)
    inside = np.zeros(gray.shape, bool)
    inside[y:y + height, x:x + width] = True
    assert_within(arcs.scaled(factor), inside)
