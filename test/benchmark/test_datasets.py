"""Data sets as folders: what is written is read, and what is wrong is named."""
from __future__ import annotations

import json
from pathlib import Path

from benchmark.datasets import Dataset, DatasetError, lens_of, View
from benchmark.scenes import rendered
import numpy as np
import pytest


@pytest.fixture(scope='module')
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Return a rendered data set."""
    return rendered.write(tmp_path_factory.mktemp('rendered'), (60, 80), 3)


def test_what_is_rendered_is_read(dataset: Dataset) -> None:
    """Three images for each lens, each with lines within it."""
    assert dataset.levels == ['undistorted', 'wide', 'fisheye']
    for view in dataset.views:
        assert view.gray.shape == (60, 80)
        assert view.lines and len(view.lines) == len(view.sagitta)
        points = np.concatenate(view.lines)
        assert (points > -1).all() and (points < (80, 60)).all()


def test_lenses_are_told_apart(dataset: Dataset) -> None:
    """Regular ones come in order, others evenly spread."""
    assert {view.level for view in dataset.of_lens('fisheye', 9)} == {'fisheye'}
    names = [view.path.stem for view in dataset.of_lens('wide', 2)]
    assert names == ['room0000', 'bars']
    assert [view.path.stem for view in dataset.of_lens('regular', 2)] == ['room0000', 'board']
    assert lens_of({'model': 'division', 'lam': -0.1}) == 'wide'
    assert lens_of({'model': 'division', 'lam': -0.6}) == 'fisheye'
    assert lens_of({'model': 'kb'}) == 'fisheye'


def test_curved_lines_are_bent_by_two_pixels() -> None:
    """Where the lens bends nothing, no subset is taken."""
    bent = View('a', Path('a'), [], np.array([0.5, 2.0]), 'wide')
    assert bent.curved.tolist() == [False, True]
    assert View('a', Path('a'), [], np.zeros(2), 'regular').curved is None


@pytest.mark.parametrize(('files', 'message'), [
    ({}, 'manifest.json: cannot be read'),
    ({'manifest.json': []}, 'lists no image'),
    ({'manifest.json': [{'level': 'a', 'image': 'a.png'}]}, 'a row has no gt'),
    ({'manifest.json': [{'level': 'a', 'image': 'a.png', 'gt': 'a.json'}],
      'a.json': {'polylines': [{'points': [[0, 0], [1, 1]]}]}}, 'a.json: is not an annotation')])
def test_what_is_wrong_is_named(files: dict, message: str, tmp_path: Path) -> None:
    """The error names the file and the missing part."""
    for name, content in files.items():
        (tmp_path / name).write_text(json.dumps(content))
    with pytest.raises(DatasetError, match=message):
        Dataset.read(tmp_path)


def test_an_image_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    """It is looked at when it is needed."""
    (tmp_path / 'manifest.json').write_text(json.dumps(
        [{'level': 'a', 'image': 'missing.png', 'gt': 'a.json'}]))
    (tmp_path / 'a.json').write_text(json.dumps({'lines': [[0, 0, 9, 9]]}))
    with pytest.raises(DatasetError, match='missing.png: cannot be read as an image'):
        Dataset.read(tmp_path).views[0].gray
