"""The RViz configuration shows what the nodes publish."""
from __future__ import annotations

from pathlib import Path

from qflsd_ros.ros.camera import CameraParameters
from qflsd_ros.ros.detector import OUTPUTS
import yaml

FILE = Path(__file__).parents[1] / 'config' / 'qflsd.rviz'
MANAGER = yaml.safe_load(FILE.read_text())['Visualization Manager']


def test_its_frame_is_that_of_the_camera() -> None:
    """In any other frame, markers need a transform that nobody publishes."""
    assert MANAGER['Global Options']['Fixed Frame'] == CameraParameters().frame_id


def test_its_topics_are_published_as_the_types_that_it_shows() -> None:
    """Each display has a topic of the detector and the type of its messages."""
    shown = {display['Topic']['Value']: display['Class'].split('/')[1]
             for display in MANAGER['Displays']}
    assert shown
    assert shown.items() <= {(topic.replace('~', '/detector'), type_.__name__)
                             for topic, type_, _ in OUTPUTS}
