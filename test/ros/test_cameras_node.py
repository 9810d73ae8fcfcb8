"""Four cameras and four detectors in namespaces, all configured by one file."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from qflsd_ros.core import Detector, Parameters
from rig import image, Rig, same, SCENE
import yaml

if TYPE_CHECKING:
    from conftest import Peer

LENGTHS = {'front': 15.0, 'left': 40.0, 'right': 130.0, 'rear': 200.0}


def parameter_file(peer: Peer) -> str:
    """Write one file for all nodes: a section for each camera, and two with wildcards."""
    sections = {f'/{side}/detector': {'ros__parameters': {'min_length': length}}
                for side, length in LENGTHS.items()}
    sections['/**'] = {'ros__parameters': {'hardware_id': 'car', 'polyline_tolerance': 0.3}}
    sections['/*/detector'] = {'ros__parameters': {'max_age': 0.0}}
    path = peer.folder / 'car.yaml'
    path.write_text(yaml.safe_dump(sections))
    return str(path)


def test_four_cameras_at_once(peer: Peer) -> None:
    file = parameter_file(peer)
    rigs = {side: Rig(peer, '-r', f'__ns:=/{side}', '-r', 'image:=camera/image_raw',
                      '--params-file', file, node=f'/{side}/detector',
                      topic=f'/{side}/camera/image_raw') for side in LENGTHS}
    found = {}
    for turn, (side, rig) in enumerate(rigs.items()):
        # A picture of its own for each: results that went astray would show.
        pixels = np.roll(SCENE, 3 * turn, axis=1)
        expected = Detector(Parameters(min_length=LENGTHS[side])).detect(pixels).polylines(0.3)
        rig.ready()
        assert same(rig.detect(image(pixels)), expected), side
        found[side] = len(expected)
    assert found['front'] > found['right'] > found['rear'] >= 0
    for side, rig in rigs.items():
        status = peer.until(lambda: next(
            (status for status in rig.reports
             if status.name == f'/{side}/detector: detection' and status.hardware_id == 'car'),
            None))
        assert 'late' not in status.message
        assert rig.process.stop() == 0
        assert 'no parameter' not in rig.process.output
