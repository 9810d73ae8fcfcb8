"""Sequences are the folders of images in a folder."""
from __future__ import annotations

from pathlib import Path

from benchmark.experiments.repeatability import sequences


def test_folders_of_images_are_sequences(tmp_path: Path) -> None:
    """Whatever else there is, a rosbag2 or a loose file, is not."""
    for name in ('b/0.png', 'b/1.png', 'a/0.JPG', 'bag/metadata.yaml', 'loose.png'):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    assert sequences(tmp_path) == [tmp_path / 'a', tmp_path / 'b']
    assert sequences(tmp_path / 'nowhere') == []
