#!/usr/bin/env python3
"""
Map the lines that the detector follows: an example of ~/planes with tracks.

python3 line_mapper.py --ros-args -r planes:=/detector/planes -r pose:=/pose

Subscribes to ``planes``, the planes of the detector with tracking, and to ``pose``, the camera in
the world: geometry_msgs/PoseStamped, or nav_msgs/Odometry with the parameter ``pose_type``.
Planes and poses are paired by their stamps; between two poses it interpolates.  Publishes
``~/lines``, a PointCloud2 with a record for each confirmed line (doc/mapping.md), and
``~/markers``, a MarkerArray, in the frame of the poses.
"""
from __future__ import annotations

from collections import Counter, deque
from typing import Any, NamedTuple

from geometry_msgs.msg import Point, PoseStamped
from nav_msgs.msg import Odometry
import numpy as np
from qflsd_ros.core.geometry import line_map, triangulation
from qflsd_ros.core.pose import between, Pose
from qflsd_ros.overlay import colours
from qflsd_ros.records import of_lines, planes_of
from qflsd_ros.ros.output.clouds import cloud, records
import rclpy
from rclpy.exceptions import InvalidParameterValueException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

POSE_TYPES = {'PoseStamped': PoseStamped, 'Odometry': Odometry}
WAITING = 60        # messages of planes that wait for their poses: two seconds at 30 Hz
POSES = 2000        # poses that are kept for planes to come: two seconds at 1 kHz
LOG_PERIOD = 5.0    # s between two warnings


class Stamped(NamedTuple):
    """A pose: its stamp in ns, unit quaternion x, y, z, w, and position in m."""

    stamp: int
    quaternion: np.ndarray
    position: np.ndarray


def stamp_of(message: Any) -> int:
    """Return the stamp of a message in ns."""
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def stamped(message: Any) -> Stamped:
    """Return the pose of a PoseStamped or Odometry; ValueError if its numbers are none."""
    pose = message.pose.pose if isinstance(message, Odometry) else message.pose
    turn, place = pose.orientation, pose.position
    quaternion = np.array([turn.x, turn.y, turn.z, turn.w])
    position = np.array([place.x, place.y, place.z])
    Pose.from_quaternion(quaternion, position)
    return Stamped(stamp_of(message), quaternion / np.linalg.norm(quaternion), position)


class Trajectory:
    """The newest poses, in the order of their stamps."""

    def __init__(self, max_gap: float) -> None:
        """Interpolate between poses that are at most ``max_gap`` s apart."""
        self._poses: deque[Stamped] = deque(maxlen=POSES)
        self._max_gap = max_gap * 1e9

    def add(self, pose: Stamped) -> None:
        """Add a pose; where stamps go back, as in a bag that starts again, forget the others."""
        if self._poses and pose.stamp < self._poses[-1].stamp:
            self._poses.clear()
        self._poses.append(pose)

    def is_ahead_of(self, stamp: int) -> bool:
        """Return whether no pose that is still to come can help at a stamp."""
        return bool(self._poses) and self._poses[-1].stamp >= stamp

    def at(self, stamp: int) -> Pose | None:
        """Return the pose at a stamp; None where no poses close enough enclose it."""
        stamps = [pose.stamp for pose in self._poses]
        after = int(np.searchsorted(stamps, stamp))
        if after == len(stamps):
            return None
        two = self._poses[after]
        if two.stamp == stamp:
            return Pose.from_quaternion(two.quaternion, two.position)
        one = self._poses[after - 1] if after else two
        if one is two or two.stamp - one.stamp > self._max_gap:
            return None
        share = (stamp - one.stamp) / (two.stamp - one.stamp)
        return Pose.from_quaternion(between(one.quaternion, two.quaternion, share),
                                    (1 - share) * one.position + share * two.position)


def markers(header: Header, tracks: np.ndarray, ends: np.ndarray, width: float) -> MarkerArray:
    """Return lines, (N, 2, 3) m, as one LINE_LIST, each in the colour of its track."""
    marker = Marker(header=header, ns='lines', type=Marker.LINE_LIST)
    marker.action = Marker.ADD if len(tracks) else Marker.DELETE
    marker.pose.orientation.w, marker.scale.x = 1.0, width
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in ends.reshape(-1, 3).tolist()]
    shades = colours(tracks).repeat(2, axis=0) / 255
    marker.colors = [ColorRGBA(r=r, g=g, b=b, a=1.0) for b, g, r in shades.tolist()]
    return MarkerArray(markers=[marker])


class LineMapper(Node):
    """Keeps a map of lines from planes and poses."""

    def __init__(self) -> None:
        super().__init__('line_mapper')
        triangulation.warm_up()
        kind = self.declare_parameter('pose_type', 'PoseStamped').value
        if kind not in POSE_TYPES:
            raise InvalidParameterValueException(
                'pose_type', kind, f'must be {" or ".join(POSE_TYPES)}')
        mount = self.declare_parameter(
            'camera_in_body', [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]).value
        if len(mount) != 7:
            raise InvalidParameterValueException(
                'camera_in_body', mount, 'must be x y z and the quaternion x y z w')
        self._mount = Pose.from_quaternion(np.array(mount[3:]), np.array(mount[:3]))
        self._width = self.declare_parameter('line_width', 0.01).value
        self._trajectory = Trajectory(self.declare_parameter('max_gap', 0.2).value)
        self._waiting: deque[PointCloud2] = deque()
        self._lost: Counter[str] = Counter()
        self._map, self._frame, self._changed = line_map.LineMap(), '', False
        reliable = QoSProfile(depth=20)
        # Any publisher of poses matches a best effort subscription.
        self.create_subscription(POSE_TYPES[kind], 'pose', self._take_pose, QoSProfile(
            depth=200, reliability=ReliabilityPolicy.BEST_EFFORT))
        self.create_subscription(PointCloud2, 'planes', self._take_planes, reliable)
        self._lines = self.create_publisher(PointCloud2, '~/lines', QoSProfile(depth=1))
        self._markers = self.create_publisher(MarkerArray, '~/markers', QoSProfile(depth=1))
        rate = self.declare_parameter('rate', 2.0).value
        if not rate > 0:
            raise InvalidParameterValueException('rate', rate, 'must be above 0 Hz')
        self.create_timer(1 / rate, self._publish)

    def _take_pose(self, message: PoseStamped | Odometry) -> None:
        try:
            self._trajectory.add(stamped(message))
        except ValueError as error:
            self._lose(str(error))
            return
        if self._frame != message.header.frame_id:
            if self._frame:
                self.get_logger().warning(
                    f'poses are in the frame {message.header.frame_id!r} now, not in '
                    f'{self._frame!r}: the map begins anew')
            self._map, self._frame = line_map.LineMap(), message.header.frame_id
        self._pair()

    def _take_planes(self, message: PointCloud2) -> None:
        if self._waiting and stamp_of(message) < stamp_of(self._waiting[-1]):
            self._lost['stamps that go back'] += len(self._waiting)
            self._waiting.clear()
        self._waiting.append(message)
        if len(self._waiting) > WAITING:
            self._waiting.popleft()
            self._lose('planes to which no pose came')
        self._pair()

    def _pair(self) -> None:
        """Map the planes whose poses have come."""
        while self._waiting and self._trajectory.is_ahead_of(stamp_of(self._waiting[0])):
            message = self._waiting.popleft()
            pose = self._trajectory.at(stamp_of(message))
            if pose is None:
                self._lose('planes between poses that are further apart than max_gap')
                continue
            camera = Pose(pose.rotation @ self._mount.rotation,
                          pose.rotation @ self._mount.centre + pose.centre)
            try:
                self._map.add(*planes_of(records(message)), camera)
                self._changed = True
            except (ValueError, KeyError, TypeError, np.linalg.LinAlgError) as error:
                self._lose(f'planes that are not those of the detector: {error}')

    def _lose(self, reason: str) -> None:
        """Count a message that could not be used, and say so from time to time."""
        self._lost[reason] += 1
        counts = ', '.join(f'{count} {reason}' for reason, count in self._lost.items())
        self.get_logger().warning(f'messages not used: {counts}',
                                  throttle_duration_sec=LOG_PERIOD)

    def _publish(self) -> None:
        if not self._changed:
            return
        self._changed = False
        mapped = self._map.lines()
        header = Header(stamp=self.get_clock().now().to_msg(), frame_id=self._frame)
        self._lines.publish(cloud(header, of_lines(mapped)))
        self._markers.publish(markers(header, mapped.tracks, mapped.lines.ends, self._width))


def main() -> None:
    """Run until SIGINT (Ctrl-C)."""
    try:
        rclpy.init()
        rclpy.spin(LineMapper())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
