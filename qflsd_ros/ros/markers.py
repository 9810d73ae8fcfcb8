"""
Arcs as a MarkerArray, already serialised.

All arcs are one LINE_LIST, whose points and colours numpy writes straight into the serialised
message: a Python object for each of ten thousand points would take longer than the detection.
Being the same marker on every frame, it neither flickers in RViz nor leaves anything behind.
"""
from __future__ import annotations

from functools import cache

from geometry_msgs.msg import Pose, Vector3
import numpy as np
from qflsd_ros import overlay
from qflsd_ros.core.arcs import Arcs
from rclpy.serialization import serialize_message
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

ENCAPSULATION = 4  # bytes in front of a CDR stream, which alignment does not count


def markers(header: Header, arcs: Arcs, tolerance: float, metres_per_pixel: float,
            line_width: float) -> bytes:
    """
    Return the arcs as one LINE_LIST marker, each in its own colour, or its deletion if none.

    Parameters
    ----------
    header
        Header of the marker.
    arcs
        What to show.
    tolerance
        Largest distance in px between an arc and its chords.
    metres_per_pixel
        Size of a pixel: points are (x, y, 0) px times this, in m.
    line_width
        Width of the lines in px.

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
    points, colours = _lines(arcs, tolerance)
    return _spliced(marker, points * metres_per_pixel, colours)


def _lines(arcs: Arcs, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of all chords, (2 S, 3) float64 px, and their colours, (2 S, 4) float32."""
    points, counts = arcs.vertices(tolerance)
    first = np.delete(np.arange(len(points)), np.cumsum(counts) - 1)
    ends = np.stack([first, first + 1], axis=1).ravel()
    flat = np.zeros((len(points), 3), '<f8')
    flat[:, :2] = points
    palette = np.ones((len(arcs), 4), '<f4')
    palette[:, :3] = overlay.colours(len(arcs))[:, ::-1] / 255
    return flat.take(ends, axis=0), np.repeat(palette, 2 * (counts - 1), axis=0)


def _spliced(marker: Marker, points: np.ndarray, colours: np.ndarray) -> bytes:
    """Serialise a marker as if it had these points and colours."""
    tail = _tail()
    empty = serialize_message(MarkerArray(markers=[marker]))
    head = empty[:len(empty) - len(tail) - 8]  # up to the lengths of points and colours
    length = np.array(len(points), '<u4').tobytes()
    padding = bytes(-(len(head) + len(length) - ENCAPSULATION) % 8)
    return b''.join([head, length, padding, points.tobytes(), length, colours.tobytes(), tail])


@cache
def _tail() -> bytes:
    """Return what follows the colours in a serialised marker; it is the same for all of ours."""
    white = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)
    whole = serialize_message(MarkerArray(markers=[Marker(colors=[white])]))
    last = np.ones(4, '<f4').tobytes()
    return whole[whole.rindex(last) + len(last):]
