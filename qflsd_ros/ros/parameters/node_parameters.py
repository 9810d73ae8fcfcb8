"""What can be set of the node, beside the detector's parameters; imports no ROS."""
from __future__ import annotations

from dataclasses import dataclass

from qflsd_ros.core.parameters import check, parameter, Parameters
from qflsd_ros.ros.output import palette
from qflsd_ros.sources.encoded import MAX_PIXELS

LENSES = ('off', 'estimate', 'fixed')


@dataclass(frozen=True)
class Settings:
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
    max_pixels: int = parameter(
        64_000_000, 'Most pixels that an image may have, a bound on memory and time; one with '
        'more is counted as bad, a compressed one before it is decoded.', '', 1, MAX_PIXELS)
    roi_x: int = parameter(
        0, 'Left edge of the region of the image in which arcs are sought.', 'px', 0, 32768)
    roi_y: int = parameter(
        0, 'Top edge of that region.', 'px', 0, 32768)
    roi_width: int = parameter(
        0, 'Width of that region; 0 stands for all the way to the right.', 'px', 0, 32768)
    roi_height: int = parameter(
        0, 'Height of that region; 0 stands for all the way down.', 'px', 0, 32768)
    mask: str = parameter(
        '', 'Image file of the size of the images, black where no arcs are sought (the robot '
        'itself, the rim of a fisheye image), white elsewhere; empty stands for none.',
        read_only=True)
    max_width: int = parameter(
        0, 'Images wider than this are made smaller by a whole number before the detection, to '
        'save time; its parameters in px then count pixels of the smaller image, its results '
        'those of the original. 0 leaves images as they are.', 'px', 0, 32768)
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
    lens: str = parameter(
        'estimate', 'The lens, which detection makes use of: off (nothing is known of it, every '
        'image is for itself), estimate (from the arcs of the images before) or fixed (by '
        'lens_lambda).', choices=LENSES)
    lens_lambda: float = parameter(
        0.0, 'Lens fixed only: lambda of the division model, 1 at half the diagonal; below 0 is a '
        'barrel.', '', -8.0, 0.6)
    lens_centre_x: float = parameter(
        0.0, 'Lens fixed only: centre of distortion; 0 stands for the middle of the image.',
        'px', 0.0, 32768.0)
    lens_centre_y: float = parameter(
        0.0, 'The same along y.', 'px', 0.0, 32768.0)
    lens_find_centre: bool = parameter(
        False, 'Lens estimate only: estimate the centre of distortion, too, for lenses that are '
        'not mounted over the middle of the sensor.')
    focal_length: float = parameter(
        0.0, 'Focal length at the centre, for ~/camera_info: straight edges do not tell it; 0 '
        'stands for half the diagonal, or less for a fisheye.', 'px', 0.0, 100000.0)
    max_age: float = parameter(
        0.5, 'Time from the stamp of an image to its results from which on diagnostics warn; '
        '0 leaves the check out.', 's', 0.0, 3600.0)
    hardware_id: str = parameter(
        '', 'Name of the camera in diagnostics; empty stands for the image topic.')

    def __post_init__(self) -> None:
        """Check types and ranges."""
        check(self)

    @property
    def has_region(self) -> bool:
        """Tell whether arcs are sought in a part of the image alone."""
        return bool(self.mask or self.roi_x or self.roi_y or self.roi_width or self.roi_height)


def check_together(detector: Parameters, node: Settings) -> None:
    """Raise ValueError where parameters of the detector and the node contradict each other."""
    if detector.method == 'paper' and node.has_region:
        raise ValueError("method is 'paper': must be 'arcs' with a mask or a region (roi_x, "
                         'roi_y, roi_width, roi_height), of which the paper knows nothing')
