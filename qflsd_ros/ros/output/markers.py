"""
Conversion of arcs into a serialised MarkerArray.

All arcs form one LINE_LIST marker.  numpy writes its points and colours directly into the
serialised message, because Python objects for ten thousand points would take longer than the
detection.  Every frame replaces the same marker, so RViz neither flickers nor shows old arcs.
"""
from __future__ import annotations

from functools import cache

from geometry_msgs.msg import Pose, Vector3
import numpy as np
from qflsd_ros.core.arcs import Arcs
from qflsd_ros.ros.output import palette
from rclpy.serialization import serialize_message
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

ENCAPSULATION = 4  # bytes of CDR's header, which alignment does not count


def markers(header: Header, arcs: Arcs, tolerance: float, metres_per_pixel: float,
            line_width: float, colour: str = 'track') -> bytes:
    """
    Return the arcs as one LINE_LIST marker, or the deletion of that marker without arcs.

    Parameters
    ----------
    header
        Header of the marker.
    arcs
        The arcs to show.
    tolerance
        Largest distance in px between an arc and its chords.
    metres_per_pixel
        Size of a pixel: points are (x, y, 0) px times this, in m.
    line_width
        Width of the lines in px.
    colour
        Meaning of the colours, one of :data:`qflsd_ros.ros.output.palette.CHOICES`.

    Returns
    -------
    serialised
        A visualization_msgs/MarkerArray as CDR, for ``Publisher.publish``.

    """
    marker = Marker(header=header, ns='arcs', type=Marker.LINE_LIST, action=Marker.ADD,
                    pose=Pose(), scale=Vector3(x=line_width * metres_per_pixel))
    if not len(arcs):
        marker.action = Marker.DELETE
        return serialize_message(MarkerArray(markers=[marker]))
    points, counts = arcs.vertices(tolerance)
    points *= metres_per_pixel
    shades = np.ones((len(arcs), 4), '<f4')
    shades[:, :3] = palette.colours(arcs, colour)[:, ::-1] / 255
    return _spliced(marker, _chords(points, counts), shades.repeat(2 * (counts - 1), axis=0))


def _chords(points: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return start and end, (S, 2, 3) float64, of all chords of polylines (N, 2)."""
    last = np.cumsum(counts)
    chords = np.zeros((len(points) - len(counts), 2, 3), '<f8')
    for side, left_out in enumerate((last - 1, last - counts)):
        kept = np.ones(len(points), bool)
        kept[left_out] = False
        chords[:, side, :2] = points.compress(kept, axis=0)
    return chords


def _spliced(marker: Marker, chords: np.ndarray, shades: np.ndarray) -> bytes:
    """
    Serialise a marker with points and colours.

    ``chords`` is (S, 2, 3) float64, ``shades`` (2 S, 4) float32: r, g, b, a of each end.
    """
    tail = _tail()
    empty = serialize_message(MarkerArray(markers=[marker]))
    head = empty[:len(empty) - len(tail) - 8]  # without the lengths of points and colours, both 0
    length = np.array(len(shades), '<u4')
    padding = bytes(-(len(head) + length.nbytes - ENCAPSULATION) % 8)
    return b''.join([head, length.tobytes(), padding, chords.data, length.tobytes(), shades.data,
                     tail])


@cache
def _tail() -> bytes:
    """Return the bytes after the colours in a serialised marker, the same for all markers."""
    white = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)
    whole = serialize_message(MarkerArray(markers=[Marker(colors=[white])]))
    last = np.ones(4, '<f4').tobytes()
    return whole[whole.rindex(last) + len(last):]
