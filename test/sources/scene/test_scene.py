"""The synthetic scene as a picture: deterministic, of any size, with the noise that is asked."""
from __future__ import annotations

from itertools import islice

import cv2
import numpy as np
import pytest
from qflsd_ros.sources import Scene, SceneFrames


def test_a_frame_is_the_same_bits_whatever_came_before():
    one, other = Scene(160, 120), Scene(160, 120)
    wanted = one.image(7)
    for number in (0, 7, 3):
        other.image(number)
    assert np.array_equal(other.image(7), wanted)
    assert np.array_equal(one.truth(7).table, other.truth(7).table)


def test_frames_and_seeds_differ():
    scene = Scene(160, 120)
    assert not np.array_equal(scene.image(0), scene.image(1))
    assert not np.array_equal(scene.image(0), Scene(160, 120, seed=1).image(0))


def test_path_is_closed_and_smooth():
    scene = Scene(160, 120, noise=0.0)
    assert np.array_equal(scene.image(0), scene.image(1200))
    changes = [cv2.absdiff(scene.image(number), scene.image(number + 1)).mean()
               for number in (0, 399, 1199)]
    assert 0 < max(changes) < 10


@pytest.mark.parametrize(('width', 'height'), [(1, 1), (2, 1), (17, 23), (8, 8), (641, 7)])
@pytest.mark.parametrize('colour', [False, True])
def test_any_size(width, height, colour):
    image, truth = Scene(width, height, colour=colour).frame(0)
    assert image.shape == ((height, width, 3) if colour else (height, width))
    assert image.dtype == np.uint8
    ends = np.concatenate([truth.table['start'], truth.table['end']])
    assert (ends > -0.5 - 1e-6).all()
    assert (ends < np.array([width - 0.5, height - 0.5]) + 1e-6).all()


def test_small_image_is_the_large_one_seen_from_afar():
    large, small = Scene(480, 360, noise=0.0).image(40), Scene(160, 120, noise=0.0).image(40)
    shrunk = cv2.resize(large, (160, 120), interpolation=cv2.INTER_AREA)
    assert cv2.absdiff(shrunk, small).mean() < 2


def test_grey_is_the_colour_image_without_colour():
    grey = Scene(160, 120, noise=0.0).image(5)
    colour = Scene(160, 120, noise=0.0, colour=True).image(5)
    assert np.ptp(colour.astype(int), axis=2).max() > 30
    assert cv2.absdiff(cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY), grey).max() <= 2


@pytest.mark.parametrize('sigma', [0.0, 2.0, 8.0])
def test_noise_has_the_deviation_asked_for(sigma):
    clean, noisy = Scene(320, 240, noise=0.0).image(3), Scene(320, 240, noise=sigma).image(3)
    difference = noisy.astype(float) - clean
    middle = (clean > 40) & (clean < 215)
    assert difference[middle].std() == pytest.approx(np.hypot(sigma, 0.4 * (sigma > 0)), rel=0.05)
    assert abs(difference[middle].mean()) < 0.1


def test_noise_is_another_one_in_every_frame():
    scene, clean = Scene(320, 240, noise=4.0), Scene(320, 240, noise=0.0)
    one, other = (scene.image(number).astype(float) - clean.image(number) for number in (0, 1))
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.02


@pytest.mark.parametrize('lam', [-1.01, 0.51])
def test_lens_that_does_not_fill_the_image_is_refused(lam):
    with pytest.raises(ValueError, match='lam is .* must lie in -1 to 0.5'):
        Scene(lam=lam)


def test_source_begins_with_frame_0_each_time():
    source = SceneFrames(Scene(32, 24))
    for _ in range(2):
        frames = list(islice(source, 3))
        assert [frame.name for frame in frames] == ['frame 0', 'frame 1', 'frame 2']
        assert frames[2].data == Scene(32, 24).image(2).tobytes()
    assert (frames[0].height, frames[0].width, frames[0].step) == (24, 32, 32)
    assert frames[0].encoding == 'mono8' and frames[0].stamp is None


@pytest.mark.slow
@pytest.mark.parametrize('lam', [-0.7, -0.5, 0.0, 0.1, 0.5])
def test_calibration_and_pose_describe_the_images(lam: float) -> None:
    """By both, the true 3-D edges are where the image shows their arcs."""
    scene = Scene(640, 480, lam, noise=0.0)
    source = SceneFrames(scene)
    frame = next(islice(source, 600, None))
    assert source.posed
    ends = scene._edge_ends.reshape(-1, 3)
    pixels = scene._camera(600).project(ends)
    inside = ((pixels >= 0) & (pixels <= (639, 479))).all(axis=1)
    assert inside.sum() > 50
    rays = source.camera.rays(pixels[inside]) @ frame.pose[:3, :3].T
    towards = ends[inside] - frame.pose[:3, 3]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    assert np.abs(rays - towards).max() < 0.1 / 360
    turn = frame.pose[:3, :3]
    assert np.allclose(turn @ turn.T, np.eye(3)) and np.linalg.det(turn) > 0


def test_camera_walks_two_metres_in_half_a_turn() -> None:
    scene = Scene(32, 24)
    places = np.array([scene.pose(number)[:3, 3] for number in range(0, 601, 5)])
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).sum() > 2


@pytest.mark.parametrize(('lam', 'count'), [(-0.75, 0), (-1.0, 1)])
def test_misfit_of_the_calibration_is_reported(lam: float, count: int) -> None:
    reports: list[str] = []
    SceneFrames(Scene(640, 480, lam), reports.append)
    assert len(reports) == count
    assert all('camera_info differs from the lens by up to' in report for report in reports)
