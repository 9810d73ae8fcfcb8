"""A node imports what it uses, so that it starts soon and stays small."""
from __future__ import annotations

import subprocess
import sys

import pytest

UNUSED = ('matplotlib', 'numba', 'qflsd_ros.cli', 'rosbags', 'tqdm')
SCENE = 'qflsd_ros.sources.scene'


@pytest.mark.parametrize('node, unused', [
    ('detector', (*UNUSED, SCENE)), ('detectors', (*UNUSED, SCENE)), ('camera', UNUSED)])
def test_nodes_import_no_bags_and_detectors_no_scene(node: str, unused: tuple[str, ...]) -> None:
    script = f'import sys, qflsd_ros.ros.{node}; print(*(set({unused}) & set(sys.modules)))'
    done = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True)
    assert (done.returncode, done.stdout.strip()) == (0, ''), done.stderr
