"""The one dispatcher of sources: kinds of paths, and the files that arguments stand for."""
from __future__ import annotations

from pathlib import Path

import pytest
from qflsd_ros.sources.opening import expand, Kind, kind_of


@pytest.mark.parametrize(('name', 'kind'), [
    ('a.png', Kind.IMAGE), ('a.JPG', Kind.IMAGE), ('a.mp4', Kind.VIDEO), ('a.txt', Kind.VIDEO),
    ('a', Kind.VIDEO), ('a.mcap', Kind.BAG), ('a.DB3', Kind.BAG)])
def test_a_file_is_of_the_kind_of_its_suffix(tmp_path: Path, name: str, kind: Kind) -> None:
    assert kind_of(tmp_path / name) is kind


@pytest.mark.parametrize('name', ['folder', 'folder.png', 'folder.mcap'])
def test_a_folder_is_a_rosbag2_if_it_has_metadata(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    assert kind_of(tmp_path / name) is Kind.FOLDER
    (tmp_path / name / 'metadata.yaml').touch()
    assert kind_of(tmp_path / name) is Kind.BAG


def test_a_pattern_stands_for_files_bags_and_the_contents_of_folders(tmp_path: Path) -> None:
    for name in ('a1/x.png', 'a1/notes.txt', 'a2/metadata.yaml', 'a3/notes.txt', 'a4.txt'):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    reports: list[str] = []
    assert expand(f'{tmp_path}/a*', reports.append) == [
        tmp_path / name for name in ('a1/x.png', 'a2', 'a4.txt')]
    assert reports == []


@pytest.mark.parametrize(('text', 'report'), [
    ('x*', 'no such file, and no file matches it'), ('', 'no image or video in this folder')])
def test_an_argument_without_a_file_is_reported(tmp_path: Path, text: str, report: str) -> None:
    reports: list[str] = []
    assert expand(f'{tmp_path}/{text}', reports.append) == []
    assert len(reports) == 1 and report in reports[0]
