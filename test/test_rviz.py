"""The RViz configuration shows what the nodes publish."""
from __future__ import annotations

from pathlib import Path

from qflsd_ros.ros.camera import CameraSettings
from qflsd_ros.ros.output.topics import OUTPUTS
import yaml

FILE = Path(__file__).parents[1] / 'config' / 'qflsd.rviz'
MANAGER = yaml.safe_load(FILE.read_text())['Visualization Manager']


def test_its_frame_is_that_of_the_camera() -> None:
    """In any other frame, markers need a transform that nobody publishes."""
    assert MANAGER['Global Options']['Fixed Frame'] == CameraSettings().frame_id


def test_its_topics_are_published_as_the_types_that_it_shows() -> None:
    """Each display has a topic of the detector and the type of its messages."""
    shown = {display['Topic']['Value']: display['Class'].split('/')[1]
             for display in MANAGER['Displays']}
    assert shown
    assert shown.items() <= {(output.topic.replace('~', '/detector'), output.message_type.__name__)
                             for output in OUTPUTS}


# What rviz_common and rviz_default_plugins (plugins_description.xml) of Jazzy offer, as far as it
# is of use here, and the settings that RViz itself writes for each.
TOPIC = {'Value', 'Depth', 'History Policy', 'Reliability Policy', 'Durability Policy',
         'Filter size'}
COMMON = {'Class', 'Name', 'Enabled', 'Value'}
DISPLAYS = {
    'rviz_default_plugins/Image': COMMON | {
        'Max Value', 'Median window', 'Min Value', 'Normalize Range', 'Topic'},
    'rviz_default_plugins/MarkerArray': COMMON | {'Namespaces', 'Topic'}}
PANELS = {'rviz_common/Displays', 'rviz_common/Selection', 'rviz_common/Time',
          'rviz_common/Tool Properties', 'rviz_common/Views'}
TOOLS = {'rviz_default_plugins/Interact', 'rviz_default_plugins/Measure',
         'rviz_default_plugins/MoveCamera', 'rviz_default_plugins/Select'}
TOP_DOWN = {'Angle', 'Class', 'Enable Stereo Rendering', 'Invert Z Axis', 'Name',
            'Near Clip Distance', 'Scale', 'Target Frame', 'Value', 'X', 'Y'}


def test_every_class_and_setting_is_one_of_rviz() -> None:
    """What RViz does not know, it drops without a word."""
    config = yaml.safe_load(FILE.read_text())
    assert set(config) == {'Panels', 'Visualization Manager', 'Window Geometry'}
    assert {panel['Class'] for panel in config['Panels']} <= PANELS
    assert set(MANAGER) <= {'Class', 'Displays', 'Enabled', 'Global Options', 'Name', 'Tools',
                            'Transformation', 'Value', 'Views'}
    assert set(MANAGER['Global Options']) == {'Background Color', 'Fixed Frame', 'Frame Rate'}
    assert {tool['Class'] for tool in MANAGER['Tools']} <= TOOLS
    for display in MANAGER['Displays']:
        assert set(display) <= DISPLAYS[display['Class']]
        assert set(display['Topic']) <= TOPIC
    view = MANAGER['Views']['Current']
    assert view['Class'] == 'rviz_default_plugins/TopDownOrtho' and set(view) <= TOP_DOWN


def test_its_quality_of_service_matches_that_of_the_node() -> None:
    """The node publishes reliably, nothing of before."""
    for display in MANAGER['Displays']:
        topic = display['Topic']
        assert topic['History Policy'] == 'Keep Last' and topic['Depth'] >= 1
        assert topic['Reliability Policy'] in ('Reliable', 'Best Effort')
        assert topic['Durability Policy'] == 'Volatile'
