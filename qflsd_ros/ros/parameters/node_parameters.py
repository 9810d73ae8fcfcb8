"""The settings of the node around the detector; imports no ROS."""
from __future__ import annotations

from dataclasses import dataclass

from qflsd_ros.core.parameters import check, parameter, Parameters
from qflsd_ros.ros.output import palette
from qflsd_ros.sources.encoded import MAX_PIXELS

LENSES = ('off', 'estimate', 'fixed')
MOST_TRAILS = 300       # images, ten seconds at 30 Hz; chosen, not tuned
MOST_CAMERAS = 16       # leaves 65535 different lines below 2^24, before numbers repeat
# Directions of the optical frame (x right, y down, z forward) by name.  All have a sign, because a
# lone y is a boolean in YAML.
UP_HINTS = {'-y': (0.0, -1.0, 0.0), '+y': (0.0, 1.0, 0.0), '-x': (-1.0, 0.0, 0.0),
            '+x': (1.0, 0.0, 0.0), '-z': (0.0, 0.0, -1.0), '+z': (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class Settings:
    """
    Parameters of the node: its images, its region, its lens and its outputs.

    Raises
    ------
    ValueError
        A value is out of its range.
    TypeError
        A value has another type than its default.

    """

    image_transport: str = parameter(
        'raw', 'Transport of the images: raw (sensor_msgs/Image on image) or compressed '
        '(sensor_msgs/CompressedImage on image/compressed).',
        choices=('raw', 'compressed'), read_only=True)
    white_level: float = parameter(
        0.0, 'Pixel value of white in images of 16 bits or of floats; 0 selects 65535 for 16 bits '
        'and 1.0 for floats.', '', 0.0, 1000000.0)
    max_pixels: int = parameter(
        64_000_000, 'Largest number of pixels in an image, which bounds memory and time. A larger '
        'image counts as bad; a compressed one is refused before it is decoded.',
        '', 1, MAX_PIXELS)
    roi_x: int = parameter(
        0, 'Left edge of the region of interest, outside of which no arcs are detected.',
        'px', 0, 32768)
    roi_y: int = parameter(
        0, 'Top edge of the region of interest.', 'px', 0, 32768)
    roi_width: int = parameter(
        0, 'Width of the region of interest; 0 extends it to the right edge of the image.',
        'px', 0, 32768)
    roi_height: int = parameter(
        0, 'Height of the region of interest; 0 extends it to the bottom edge of the image.',
        'px', 0, 32768)
    mask: str = parameter(
        '', 'Image file of the same size as the camera images: black where no arcs are detected '
        '(the robot itself, the rim of a fisheye image), white elsewhere. Empty selects no mask.',
        read_only=True)
    max_width: int = parameter(
        0, 'Images wider than this are reduced by a whole factor before detection, which saves '
        'time. Detector parameters in px then refer to the reduced image, results to the original '
        'image. 0 never reduces.', 'px', 0, 32768)
    tracking: bool = parameter(
        True, 'Follow lines from image to image, so that each keeps its identity (track); false '
        'detects each image by itself. Method arcs only: the method paper has no tracks.')
    polyline_tolerance: float = parameter(
        0.1, 'Largest distance between an arc and its polyline on ~/segments and ~/markers.',
        'px', 0.001, 100.0)
    line_width: int = parameter(
        1, 'Width of the lines on ~/overlay and ~/markers.', 'px', 1, 100)
    trails: int = parameter(
        0, 'Past images whose positions of each track form its tail on ~/overlay; 0 draws none.',
        'images', 0, MOST_TRAILS)
    marker_colour: str = parameter(
        'track', 'Meaning of the colours on ~/markers: track (a line keeps its colour; without '
        'tracking as id), id (a different colour for each arc of an image), length, curvature or '
        'score (blue is low, red is high), or direction (by the axes of attitude).',
        choices=palette.CHOICES)
    metres_per_pixel: float = parameter(
        0.01, 'Size of a pixel on ~/markers.', 'm', 0.0001, 1000.0)
    lens: str = parameter(
        'estimate', 'Origin of the lens distortion that detection takes into account: off (no '
        'distortion is assumed, and each image is processed by itself), estimate (from the arcs '
        'of previous images) or fixed (by lens_lambda).', choices=LENSES)
    lens_lambda: float = parameter(
        0.0, 'Lens fixed only: lambda of the division model, with half the image diagonal as the '
        'unit of length; negative values are barrel distortion.', '', -8.0, 0.6)
    lens_centre_x: float = parameter(
        0.0, 'Lens fixed only: x of the centre of distortion; 0 selects the centre of the image.',
        'px', 0.0, 32768.0)
    lens_centre_y: float = parameter(
        0.0, 'Lens fixed only: y of the centre of distortion; 0 selects the centre of the image.',
        'px', 0.0, 32768.0)
    lens_find_centre: bool = parameter(
        False, 'Lens estimate only: estimate the centre of distortion as well, for lenses that '
        'are not mounted over the centre of the sensor.')
    focal_length: float = parameter(
        0.0, 'Focal length at the centre of distortion, for ~/camera_info, because straight edges '
        'alone do not determine it; 0 selects half the image diagonal, or less for a fisheye.',
        'px', 0.0, 100000.0)
    attitude: bool = parameter(
        False, 'Estimate from the arcs which way is up, the axes of the place and the focal '
        'length (~/attitude, ~/gravity, direction in ~/arcs). A calibrated camera_info beside the '
        'images is used where there is one.')
    up_hint: str = parameter(
        '-y', 'Approximate direction of up in the first image, in the optical frame (x right, y '
        'down, z forward): -y, +y, -x, +x, -z or +z; up is the axis of the place closest to it.',
        choices=tuple(UP_HINTS))
    focal: str = parameter(
        'off', 'Focal length on ~/camera_info: off (focal_length, or a plausible one), estimate '
        '(the true one by attitude, K is 0 until it is known) or fixed (focal_length is the true '
        'one, which attitude uses too).', choices=LENSES)
    draw_attitude: bool = parameter(
        True, 'Draw horizon and axes of the place on ~/overlay while attitude is on.')
    max_bend: float = parameter(
        0.5, 'Diagnostics warn when arcs of straight edges stay bent by significantly more than '
        'this after undistortion by the camera_info beside the images; 0 disables the warning. '
        'Needs attitude.', 'px', 0.0, 100.0)
    line_features_rate: float = parameter(
        10.0, 'Messages per second on ~/line_features, of the images closest to regular times by '
        'their stamps: every k-th one at a rate that divides that of the camera. 0 selects every '
        'image.', 'Hz', 0.0, 1000.0)
    line_features_max: int = parameter(
        70, 'Largest number of lines in a message on ~/line_features, balanced over orientations '
        'and quarters of the image, lines chosen before and long tracks first.', '', 1, 10000)
    line_features_min_length: float = parameter(
        30.0, 'Shortest line on ~/line_features; PL-VINS uses lines from 60 px on.',
        'px', 0.0, 10000.0)
    cameras: int = parameter(
        1, 'Number of cameras whose lines a subscriber of ~/line_features takes: its id is that '
        'of the line times cameras plus camera_index.', '', 1, MOST_CAMERAS)
    camera_index: int = parameter(
        0, 'Which of the cameras this one is, from 0 to cameras - 1.', '', 0, MOST_CAMERAS - 1)
    max_age: float = parameter(
        0.5, 'Diagnostics warn when the median time from the stamp of an image to its results '
        'exceeds this; 0 disables the warning.', 's', 0.0, 3600.0)
    hardware_id: str = parameter(
        '', 'Name of the camera in diagnostics; empty selects the name of the image topic.')

    def __post_init__(self) -> None:
        """Check types and ranges."""
        check(self)

    @property
    def has_region(self) -> bool:
        """Return whether a mask or a region of interest excludes part of the image."""
        return bool(self.mask or self.roi_x or self.roi_y or self.roi_width or self.roi_height)


def check_together(parameters: Parameters, settings: Settings) -> None:
    """Raise ValueError if parameters of the detector and the node contradict each other."""
    if settings.focal == 'estimate' and not settings.attitude:
        raise ValueError("focal is 'estimate' and attitude is false: attitude must be true to "
                         'estimate the focal length (in a running node, change attitude first to '
                         'begin, focal first to end, or both by set_parameters_atomically)')
    if settings.focal == 'fixed' and not settings.focal_length:
        raise ValueError("focal is 'fixed' and focal_length is 0: focal_length must be the focal "
                         'length in px')
    if settings.camera_index >= settings.cameras:
        raise ValueError(f'camera_index is {settings.camera_index} and cameras is '
                         f'{settings.cameras}: camera_index must be below cameras')
    if parameters.method == 'paper' and settings.has_region:
        raise ValueError("method is 'paper': must be 'arcs' with a mask or a region of interest "
                         '(roi_x, roi_y, roi_width, roi_height), which the paper does not have')


def tracks_lines(parameters: Parameters, settings: Settings) -> bool:
    """Return whether lines are tracked: the method paper leaves no gradients to follow them by."""
    return settings.tracking and parameters.method == 'arcs'
