"""A node imports what it uses, so that it starts soon and stays small."""
from __future__ import annotations

import subprocess
import sys

import pytest

UNUSED = ('matplotlib', 'qflsd_ros.cli', 'qflsd_ros.sources.scene', 'rosbags', 'tqdm')


@pytest.mark.parametrize('node', ['detector', 'detectors'])
def test_detectors_import_neither_bags_nor_the_scene(node: str) -> None:
    script = f'import sys, qflsd_ros.ros.{node}; print(*(set({UNUSED}) & set(sys.modules)))'
    done = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True)
    assert (done.returncode, done.stdout.strip()) == (0, ''), done.stderr
