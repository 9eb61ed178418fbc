"""Poses at a moment and straightened sweeps."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from perception_core import NS, PoseBuffer, PoseUnavailableError, Sweep, deskew

T0 = 100 * NS


def flight(velocity, yaw_rate_rad_s, *, start_ns=T0, seconds=1.0, hz=50) -> PoseBuffer:
    poses = PoseBuffer()
    for k in range(int(seconds * hz) + 1):
        t = k / hz
        poses.add(start_ns + int(t * NS), tuple(np.array(velocity) * t), Rotation.from_euler("z", yaw_rate_rad_s * t).as_quat())
    return poses


@given(st.floats(0.0, 1.0), st.floats(-3.0, 3.0), st.floats(-1.5, 1.5))
@settings(max_examples=50)
def test_interpolation_meets_a_steady_motion_everywhere(t, speed, yaw_rate) -> None:
    pose = flight((speed, 0.0, 0.0), yaw_rate).at([T0 + int(t * NS)])
    assert pose.position[0] == pytest.approx([speed * t, 0.0, 0.0], abs=1e-6)
    assert Rotation.from_matrix(pose.rotation[0]).as_euler("ZYX")[0] == pytest.approx(yaw_rate * t, abs=1e-6)


def test_moments_out_of_reach_are_refused_and_near_ones_clamped() -> None:
    poses = flight((1.0, 0.0, 0.0), 0.0)
    assert poses.at([T0 + int(1.1 * NS)]).position[0][0] == pytest.approx(1.0)
    for t in (-0.2, 1.2):
        with pytest.raises(PoseUnavailableError, match=r"0\.20 s away"):
            poses.at([T0 + int(t * NS)])
    with pytest.raises(PoseUnavailableError, match="no pose was received"):
        PoseBuffer().at([T0])


def test_a_clock_that_jumps_back_forgets_the_future() -> None:
    poses = flight((1.0, 0.0, 0.0), 0.0)
    poses.add(T0 - NS, (7.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    assert poses.at([T0 - NS]).position[0][0] == pytest.approx(7.0)
    with pytest.raises(PoseUnavailableError):
        poses.at([T0])


def sensor() -> np.ndarray:
    mount = np.eye(4)
    mount[:3, :3] = Rotation.from_euler("xyz", [0.3, -1.2, 0.7]).as_matrix()
    mount[:3, 3] = [0.1, -0.2, 0.3]
    return mount


@given(st.integers(1, 200), st.integers(0, 2**31))
@settings(max_examples=40)
def test_standing_still_a_sweep_is_moved_rigidly(count, seed) -> None:
    rng = np.random.default_rng(seed)
    sweep = Sweep(T0, rng.uniform(-20, 20, (count, 3)).astype(np.float32), rng.uniform(0, 0.1, count).astype(np.float32))
    poses = flight((0.0, 0.0, 0.0), 0.0)
    expected = sweep.points @ sensor()[:3, :3].T + sensor()[:3, 3]
    assert deskew(sweep, poses, sensor(), np.zeros(3)) == pytest.approx(expected, abs=1e-5)


@given(st.integers(0, 2**31), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0))
@settings(max_examples=40)
def test_a_moving_sensor_sees_a_standing_world_where_it_is(seed, yaw_rate, speed) -> None:
    rng = np.random.default_rng(seed)
    world = rng.uniform(-20, 20, (300, 3))
    times = np.sort(rng.uniform(0, 0.1, 300)).astype(np.float32)
    poses = flight((speed, 0.5, 0.0), yaw_rate)
    mount = sensor()
    at = poses.at([T0 + int(float(t) * NS) for t in times])
    seen = np.einsum("nji,nj->ni", at.rotation, world - at.position)
    seen = (seen - mount[:3, 3]) @ mount[:3, :3]
    straight = deskew(Sweep(T0, seen.astype(np.float32), times), poses, mount, np.zeros(3))
    assert np.abs(straight - world).max() < 0.002  # metres, at up to 35 m


def test_range_limits_drop_points_together_with_their_times() -> None:
    points = np.array([[0.5, 0, 0], [3, 0, 0], [np.nan, 0, 0], [30, 0, 0], [4, 0, 0]], dtype=np.float32)
    near = Sweep(T0, points, np.arange(5, dtype=np.float32)).within(1.2, 20.0)
    assert near.points[:, 0].tolist() == [3.0, 4.0]
    assert near.times_s.tolist() == [1.0, 4.0]
    assert near.end_ns == T0 + 4 * NS


def test_an_empty_sweep_stays_empty_without_any_pose() -> None:
    empty = Sweep(T0, np.empty((0, 3), np.float32), np.empty(0, np.float32))
    assert deskew(empty, PoseBuffer(), np.eye(4), np.zeros(3)).shape == (0, 3)


def test_a_measurement_waits_for_the_pose_of_its_moment():
    poses = PoseBuffer()
    poses.add(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    assert not poses.wait_for(NS, timeout_s=0.01)
    late = threading.Timer(0.05, poses.add, (NS, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    late.start()
    assert poses.wait_for(NS, timeout_s=10.0)
    late.join()


@pytest.mark.parametrize(
    ("position", "attitude"),
    [((np.nan, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), ((0.0, 0.0, 0.0), (0.0, np.inf, 0.0, 1.0)), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))],
)
def test_a_pose_that_is_none_is_left_out(position, attitude) -> None:
    poses = PoseBuffer()
    poses.add(0, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))
    poses.add(NS // 50, position, attitude)
    poses.add(NS // 25, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))
    found = poses.at([NS // 50])
    assert found.position[0] == pytest.approx([1.0, 2.0, 3.0])
    assert found.rotation[0] == pytest.approx(np.eye(3))
