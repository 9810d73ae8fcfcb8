"""The example that matches the lines of two cameras, as a process over real DDS."""
from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from builtin_interfaces.msg import Time
import numpy as np
import pytest
from qflsd_ros import records
from qflsd_ros.ros.output import clouds
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

if TYPE_CHECKING:
    from conftest import Peer

EXAMPLE = 'examples/stereo_matcher.py'
LINES = np.array([[[0.5, -1, 2.5], [0.6, 1, 2.6]], [[-1.0, -0.6, 3], [-0.4, 0.6, 3.5]],
                  [[-0.5, 0.8, 3], [-0.4, 0.2, 4]]])
BASELINE = 0.25     # m


def see(centre: np.ndarray, order: list[int], tracks: list[int], header: Header
        ) -> tuple[PointCloud2, PointCloud2]:
    """Return planes and arcs of a camera that looks along z; the contrast is that of the line."""
    rays = LINES[order] - centre
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    normals = np.cross(rays[:, 0], rays[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    table, arcs = np.zeros(3, records.PLANE), np.zeros(3, records.ARC)
    for column, axis in enumerate('xyz'):
        table[f'normal_{axis}'] = normals[:, column]
        table[f'start_{axis}'], table[f'end_{axis}'] = rays[:, 0, column], rays[:, 1, column]
    for i, j, axes in zip(*np.triu_indices(3), records.COVARIANCE):
        table[f'covariance_{axes}'] = 1e-8 * ((i == j) - normals[:, i] * normals[:, j])
    table['track'], table['segment'] = tracks, np.arange(3)
    arcs['contrast'] = 20.0 * (1 + np.array(order))
    return clouds.cloud(header, table), clouds.cloud(header, arcs)


def test_lines_of_the_same_stamp_are_matched(peer: Peer) -> None:
    found: list[PointCloud2] = []
    peer.node.create_subscription(PointCloud2, '/stereo_matcher/lines', found.append, 10)
    topics = [peer.node.create_publisher(PointCloud2, topic, 10)
              for topic in ('left/planes', 'left/arcs', 'right/planes', 'right/arcs')]
    example = peer.run(EXAMPLE, '--ros-args', '-p',
                       f'right_in_left:=[{BASELINE}, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]')
    numbers = itertools.count(1)

    def publish() -> None:
        header = Header(stamp=Time(sec=next(numbers)), frame_id='left')
        messages = (*see(np.zeros(3), [0, 1, 2], [4, 9, 6], header),
                    *see(np.array([BASELINE, 0, 0]), [2, 0, 1], [60, 40, 90], header))
        for topic, message in zip(topics, messages):
            topic.publish(message)
    peer.until(lambda: found, publish)
    rows = clouds.records(found[0])
    assert found[0].header.frame_id == 'left'
    assert rows['track'].tolist() == [4, 9, 6] and rows['right_track'].tolist() == [40, 90, 60]
    starts = np.stack([rows[f'start_{axis}'] for axis in 'xyz'], axis=1)
    assert starts == pytest.approx(LINES[:, 0], abs=1e-3)

    def alone() -> None:
        topics[0].publish(see(np.zeros(3), [0, 1, 2], [4, 9, 6],
                              Header(stamp=Time(sec=next(numbers))))[0])
    peer.until(lambda: 'are the cameras synchronised?' in example.output, alone)
    publish()
    before = len(found)
    peer.until(lambda: len(found) > before, publish)
