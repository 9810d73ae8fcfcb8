"""The layout for Foxglove shows topics that the detector publishes, each panel in its place."""
from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Iterator

from qflsd_ros.ros.output.topics import OUTPUTS

LAYOUT = json.loads((Path(__file__).parents[1] / 'config' / 'foxglove.json').read_text())


def leaves(node: Any) -> Iterator[Any]:
    """Return everything in a tree that is no dictionary or list, and the keys as well."""
    if isinstance(node, dict):
        for key, value in node.items():
            yield key
            yield from leaves(value)
    elif isinstance(node, list):
        for value in node:
            yield from leaves(value)
    else:
        yield node


def panels(node: Any) -> Iterator[str]:
    """Return the panels of a layout, from the first to the last."""
    if isinstance(node, str):
        yield node
    else:
        yield from panels(node['first'])
        yield from panels(node['second'])


def test_every_panel_has_a_place_and_a_configuration() -> None:
    shown = list(panels(LAYOUT['layout']))
    assert sorted(shown) == sorted(LAYOUT['configById']) and len(shown) == len(set(shown))


def test_topics_are_those_of_the_node() -> None:
    published = {output.topic.replace('~', '/detector') for output in OUTPUTS}
    named = {leaf.partition('.')[0] for leaf in leaves(LAYOUT['configById'])
             if isinstance(leaf, str) and leaf.startswith('/')}
    assert named == {'/detector/overlay', '/detector/markers', '/detector/arcs', '/diagnostics'}
    assert named <= published | {'/diagnostics'}


# Panels of Foxglove, as far as they are of use here, and the settings that it writes for each.
PANELS = {
    'Image': {'cameraState', 'followMode', 'imageMode', 'layers', 'publish', 'scene', 'topics',
              'transforms'},
    '3D': {'cameraState', 'followMode', 'imageMode', 'layers', 'publish', 'scene', 'topics',
           'transforms'},
    'DiagnosticStatusPanel': {'collapsedSections', 'selectedHardwareId', 'selectedName',
                              'splitFraction', 'topicToRender'},
    'Plot': {'isSynced', 'legendDisplay', 'paths', 'showLegend', 'showPlotValuesInLegend',
             'showXAxisLabels', 'showYAxisLabels', 'sidebarDimension', 'title', 'xAxisVal'}}
CAMERA = {'distance', 'far', 'fovy', 'near', 'perspective', 'phi', 'target', 'targetOffset',
          'targetOrientation', 'thetaOffset'}


def splits(node: Any) -> Iterator[Any]:
    """Return the places of a layout where it divides."""
    if isinstance(node, dict):
        yield node
        yield from splits(node['first'])
        yield from splits(node['second'])


def test_every_panel_and_setting_is_one_of_foxglove() -> None:
    """It is laid out like the layouts that Foxglove exports."""
    assert set(LAYOUT) <= {'configById', 'globalVariables', 'layout', 'playbackConfig',
                           'userNodes'}
    for name, config in LAYOUT['configById'].items():
        kind, mark, identity = name.partition('!')
        assert set(config) <= PANELS[kind] and mark and identity
        assert set(config.get('cameraState', {})) <= CAMERA
    for path in LAYOUT['configById']['Plot!arcs']['paths']:
        assert set(path) <= {'enabled', 'timestampMethod', 'value'}
        assert path['timestampMethod'] in ('headerStamp', 'receiveTime')
    for split in splits(LAYOUT['layout']):
        assert set(split) <= {'direction', 'first', 'second', 'splitPercentage'}
        assert split['direction'] in ('row', 'column')
