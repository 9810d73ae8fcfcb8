"""
Messages of orientation: that of the attitude by REP 145, gravity, and the pose of a camera.

The world of the attitude has z upwards.  Its x axis is a horizontal direction of the place, so
that yaw is arbitrary; it is continuous while the attitude is followed.
"""
from __future__ import annotations

from geometry_msgs.msg import (
    Point, Pose, PoseStamped, Quaternion, Vector3, Vector3Stamped)
import numpy as np
from qflsd_ros.core import Attitude
from sensor_msgs.msg import Imu
from std_msgs.msg import Header

# Variance of yaw, rad^2: that of any angle is pi^2 / 3; far above, filters ignore it.
YAW_VARIANCE = 1e6
ABSENT = [-1.0] + [0.0] * 8     # by the definition of sensor_msgs/Imu, in the first element


def rotation(attitude: Attitude) -> np.ndarray:
    """Return the rotation from the optical frame to the world, (3, 3), right-handed."""
    up, along = attitude.directions[:2]
    return np.stack([along, np.cross(up, along), up])


def quaternion(matrix: np.ndarray) -> np.ndarray:
    """
    Return the unit quaternion x, y, z, w of a rotation matrix, (4,), w >= 0.

    It is the eigenvector of the greatest eigenvalue of a symmetric matrix (I. Y. Bar-Itzhack, New
    method for extracting the quaternion from a rotation matrix, 2000), exact at any angle.
    """
    m, trace = matrix, np.trace(matrix)
    k = np.empty((4, 4))
    k[:3, :3] = m + m.T - trace * np.eye(3)
    k[3, :3] = k[:3, 3] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    k[3, 3] = trace
    found = np.linalg.eigh(k)[1][:, -1]
    return found if found[3] >= 0 else -found


def imu(header: Header, attitude: Attitude) -> Imu:
    """
    Return the orientation of the optical frame against the world; up must be known.

    The covariance is about the world's axes; rates and accelerations are marked absent.
    """
    assert attitude.up_std is not None
    x, y, z, w = quaternion(rotation(attitude)).tolist()
    tilt = attitude.up_std ** 2
    return Imu(header=header, orientation=Quaternion(x=x, y=y, z=z, w=w),
               orientation_covariance=np.diag([tilt, tilt, YAW_VARIANCE]).ravel(),
               angular_velocity_covariance=ABSENT, linear_acceleration_covariance=ABSENT)


def gravity(header: Header, attitude: Attitude) -> Vector3Stamped:
    """Return the unit vector downwards, the direction of gravity, in the optical frame."""
    x, y, z = (-attitude.directions[0]).tolist()
    return Vector3Stamped(header=header, vector=Vector3(x=x, y=y, z=z))


def pose(header: Header, matrix: np.ndarray) -> PoseStamped:
    """Return the pose of a camera; ``matrix`` is (4, 4), from its optical frame to the map, m."""
    x, y, z = matrix[:3, 3].tolist()
    a, b, c, w = quaternion(matrix[:3, :3]).tolist()
    return PoseStamped(header=header, pose=Pose(
        position=Point(x=x, y=y, z=z), orientation=Quaternion(x=a, y=b, z=c, w=w)))
