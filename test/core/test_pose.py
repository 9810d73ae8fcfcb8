"""Poses, their quaternions, and what lies between two."""
from __future__ import annotations

import numpy as np
import pytest
from qflsd_ros.core.pose import between, Pose

HALF = np.sqrt(0.5)


def test_a_quarter_turn_about_z_takes_x_to_y():
    pose = Pose.from_quaternion(np.array([0, 0, HALF, HALF]), np.array([1.0, 2, 3]))
    assert pose.rotation @ (1, 0, 0) == pytest.approx(np.array([0, 1, 0]))
    assert pose.centre.tolist() == [1, 2, 3]


def test_length_and_sign_of_a_quaternion_do_not_matter():
    quaternion = np.array([0.1, -0.4, 0.3, 0.7])
    once = Pose.from_quaternion(quaternion, np.zeros(3)).rotation
    assert Pose.from_quaternion(-3 * quaternion, np.zeros(3)).rotation == pytest.approx(once)
    assert once @ once.T == pytest.approx(np.eye(3))


@pytest.mark.parametrize('quaternion', [(0.0, 0, 0, 0), (np.nan, 0, 0, 1)])
def test_what_is_no_rotation_is_refused(quaternion):
    with pytest.raises(ValueError, match='are no pose'):
        Pose.from_quaternion(np.array(quaternion), np.zeros(3))


def test_a_pose_relative_to_another():
    one = Pose.from_quaternion(np.array([0.1, -0.4, 0.3, 0.7]), np.array([1.0, 2, 3]))
    two = Pose.from_quaternion(np.array([0.5, 0.2, -0.3, 0.7]), np.array([-1.0, 0, 1]))
    point = np.array([0.3, 0.2, 4])
    relative = two.relative_to(one)
    there = relative.rotation @ point + relative.centre
    assert one.rotation @ there + one.centre == pytest.approx(two.rotation @ point + two.centre)


@pytest.mark.parametrize('sign', [1, -1])
def test_halfway_of_a_turn_is_half_the_angle(sign):
    none, turn = np.array([0, 0, 0, 1.0]), sign * np.array([0, np.sin(0.5), 0, np.cos(0.5)])
    wanted = np.array([0, np.sin(0.15), 0, np.cos(0.15)])
    assert between(none, turn, 0.3) == pytest.approx(wanted)


def test_between_the_same_is_the_same():
    same = np.array([0.5, 0.5, -0.5, 0.5])
    assert between(same, same.copy(), 0.4) == pytest.approx(same)
