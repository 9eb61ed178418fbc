"""From a sweep to the obstacle ahead of the motion, and the judging of clouds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lidar_obstacles import CloudJudge, LidarSettings, obstacle_ahead
from perception_core import NS, Motion, PoseBuffer, Sweep
from perception_core.testing import box_cloud

T_BASE_LIDAR = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # spins across the nose


def sweep(points, times=None) -> Sweep:
    return Sweep(NS, points.astype(np.float32), np.zeros(len(points), np.float32) if times is None else times.astype(np.float32))


def crab(yaw=0.0, position=(0.0, 0.0, 3.0), velocity=(0.0, 0.0, 0.0)) -> PoseBuffer:
    poses = PoseBuffer()
    for k in range(6):
        at = np.array(position) + np.array(velocity) * 0.02 * k
        poses.add(NS + k * NS // 50, tuple(at), Rotation.from_euler("z", yaw).as_quat())
    return poses


def look(cloud, poses, motion):
    return obstacle_ahead(cloud, T_base_lidar=T_BASE_LIDAR, poses=poses, motion=motion, settings=LidarSettings().ahead)


@given(st.floats(-3.1, 3.1), st.floats(2.5, 10.0), st.integers(0, 1000))
@settings(max_examples=40, deadline=None)
def test_sideways_flight_sees_what_is_beside_the_nose_whatever_the_yaw(yaw, distance, seed) -> None:
    # base left = sensor x: the box is to the left, and the vehicle flies to its left.
    cloud = box_cloud((distance, 0.0, 0.0), seed=seed)
    cloud[:, [1, 2]] = cloud[:, [2, 1]]  # the cloud's ground is below: sensor y is up
    left = (-np.sin(yaw), np.cos(yaw), 0.0)
    found = look(sweep(cloud), crab(yaw), Motion(velocity_enu_m_s=tuple(0.8 * np.array(left))))
    assert found is not None
    assert found.distance_m == pytest.approx(distance - 0.25, abs=0.15)
    assert np.array(found.point_enu_m)[:2] @ np.array(left)[:2] == pytest.approx(found.distance_m, abs=0.1)
    right = Motion(velocity_enu_m_s=tuple(-0.8 * np.array(left)))
    assert look(sweep(cloud), crab(yaw), right) is None


def test_own_returns_and_ground_are_no_obstacle() -> None:
    cloud = box_cloud((99.0, 0.0, 0.0), seed=3)[60:]
    cloud[:, [1, 2]] = cloud[:, [2, 1]]
    for target in ((0.0, 20.0, 3.0), (0.0, -20.0, 3.0), (20.0, 0.0, 3.0)):
        assert look(sweep(cloud), crab(), Motion(target_enu_m=target)) is None


def test_a_sweep_in_motion_is_measured_from_its_end() -> None:
    velocity = (0.0, 2.0, 0.0)
    times = np.linspace(0.0, 0.1, 50)
    wall = np.column_stack([6.0 - 2.0 * times, np.linspace(-0.3, 0.3, 50), np.linspace(-0.3, 0.3, 50)])
    found = look(sweep(wall, times), crab(velocity=velocity), Motion(velocity_enu_m_s=velocity))
    assert found is not None
    assert found.distance_m == pytest.approx(5.8, abs=0.01)


def test_empty_and_frozen_clouds_are_complained_about() -> None:
    judge = CloudJudge(min_returns=20, self_m=1.2)
    first, second = box_cloud((5.0, 0.0, 0.0), seed=1), box_cloud((5.0, 0.0, 0.0), seed=2)
    assert judge.complaint(first.tobytes(), sweep(first)) == ""
    assert judge.complaint(second.tobytes(), sweep(second)) == ""
    assert judge.complaint(second.tobytes(), sweep(second)) == "cloud is frozen"
    own = first[-50:]
    assert judge.complaint(own.tobytes(), sweep(own)) == "cloud is empty: 0 returns"
    nothing = np.full((100, 3), np.nan, np.float32)
    assert judge.complaint(nothing.tobytes(), sweep(nothing)) == "cloud is empty: 0 returns"
