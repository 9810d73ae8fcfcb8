"""The grid of the published method: its copy of the search, its images, and its choice."""
from __future__ import annotations

import dataclasses
from pathlib import Path
from unittest import mock

from benchmark.datasets import Dataset
from benchmark.experiment import Experiment, QUICK
from benchmark.experiments import paper_grid, published_search
from benchmark.peers import published
from benchmark.scenes.rendered import write
import numpy as np
from qflsd_ros.core import paper, Parameters

PARAMETERS = Parameters(method='paper', paper_epsilon=2.0, min_length=10.0)


def test_the_compiled_search_finds_the_segments_of_the_published_one() -> None:
    """Two arcs of circles, joined at a corner, as both take them apart."""
    turn = np.linspace(0, 1.5, 90)[:, None]
    contour = np.concatenate([50 * np.hstack([np.cos(turn), np.sin(turn)]),
                              [3.54, 49.9] + 40 * np.hstack([np.sin(turn), 1 - np.cos(turn)])])
    for search in (paper.segments, published_search.segments):
        found = search(contour, PARAMETERS, np.random.default_rng(0))
        assert sum(map(len, found)) > 170 and max(map(len, found)) >= 80


def test_a_contour_without_segments_ends() -> None:
    """Too short, or nothing but the same pixel."""
    for contour in (np.zeros((5, 2)), np.zeros((40, 2))):
        assert published_search.segments(contour, PARAMETERS, None) == []


def test_images_of_table_one_are_not_used(tmp_path: Path) -> None:
    """The others of the data set are, and rendered ones."""
    rendered = write(tmp_path, QUICK.shape, QUICK.per_lens)
    data = Dataset(tmp_path, [dataclasses.replace(view, level=f'level {i}')
                              for i, view in enumerate(rendered.views * 4)], [])
    experiment = Experiment(data, rendered, (), None, (), tmp_path, QUICK, False)
    used = {view.name for view in data.of_lens('regular', QUICK.per_lens)}
    chosen = paper_grid.held_out(experiment)
    assert {view.lens for view in chosen} == {'regular', 'wide'}
    assert not used & {view.name for view in chosen}


def test_the_choice_is_on_the_grid() -> None:
    """All open parameters of config/paper.yaml are one of its combinations."""
    chosen = published()
    assert any(abs(one.contrast_low - chosen.contrast_low) < 1e-3 and dataclasses.replace(
        one, contrast_low=chosen.contrast_low) == chosen for one in paper_grid.grid())


def test_the_search_is_replaced_while_an_image_is_measured(tmp_path: Path) -> None:
    """And only then."""
    view = write(tmp_path, QUICK.shape, 1).views[0]
    before = paper.segments
    with mock.patch.object(published_search, 'segments', wraps=published_search.segments) as used:
        counts = paper_grid.count(paper_grid.Task(published(), view))
    assert used.called and counts.lines > 0 and paper.segments is before
