"""What can be set of the node, beside the detector's parameters; imports no ROS."""
from __future__ import annotations

from dataclasses import dataclass

from qflsd_ros.core.parameters import check, parameter
from qflsd_ros.ros import palette


@dataclass(frozen=True)
class NodeParameters:
    """
    What a user can set of the node around the detector.

    Raises
    ------
    ValueError
        A value is out of its range.
    TypeError
        A value has another type than its default.

    """

    image_transport: str = parameter(
        'raw', 'How images come: raw (sensor_msgs/Image on image) or compressed '
        '(sensor_msgs/CompressedImage on image/compressed).',
        choices=('raw', 'compressed'), read_only=True)
    white_level: float = parameter(
        0.0, 'Value that becomes white in images of 16 bits or floats; 0 stands for 65535 with '
        '16 bits and for 1.0 with floats.', '', 0.0, 1000000.0)
    polyline_tolerance: float = parameter(
        0.1, 'Largest distance between an arc and its points on ~/segments and ~/markers.',
        'px', 0.001, 100.0)
    line_width: int = parameter(
        1, 'Width of the arcs on ~/overlay and ~/markers.', 'px', 1, 100)
    marker_colour: str = parameter(
        'id', 'What the colours on ~/markers stand for: id (each arc has its own), length, '
        'curvature or score (from blue, low, to red, high).', choices=palette.CHOICES)
    metres_per_pixel: float = parameter(
        0.01, 'Size of a pixel on ~/markers.', 'm', 0.0001, 1000.0)
    max_age: float = parameter(
        0.5, 'Time from the stamp of an image to its results from which on diagnostics warn; '
        '0 leaves the check out.', 's', 0.0, 3600.0)
    hardware_id: str = parameter(
        '', 'Name of the camera in diagnostics; empty stands for the image topic.')

    def __post_init__(self) -> None:
        """Check types and ranges."""
        check(self)
