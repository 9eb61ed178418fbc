"""The core of the node, fed with sweeps and poses; needs ROS's Python, but no master."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lidar_obstacles.core import LidarObstacles
from lidar_obstacles.settings import LidarSettings
from perception_bench.recordings import RecordingHost
from perception_core import NS, FaultKind, Finding, Sweep, Verdict

HEIGHT_M, CLIMB_M_S = 3.0, 2.0


def over_ground(height_m: float, seed: int) -> np.ndarray:
    """Return what a sensor that looks down sees of level ground."""
    azimuth, down = np.meshgrid(np.radians(np.arange(0.0, 360.0, 1.0)), np.radians(np.arange(50.0, 80.0, 2.0)))
    ray = np.stack([np.cos(down) * np.cos(azimuth), np.cos(down) * np.sin(azimuth), -np.sin(down)], axis=-1).reshape(-1, 3)
    ranges = height_m / -ray[:, 2] + np.random.default_rng(seed).normal(0, 0.01, len(ray))
    return (ray * ranges[:, None]).astype(np.float32)


@pytest.mark.parametrize("late_s", [0.0, 0.04, 0.12])
def test_poses_that_are_late_make_no_error_of_a_climb(late_s: float) -> None:
    host = RecordingHost()
    core = LidarObstacles(LidarSettings(), host)
    core.vehicle.set_mount("base_link", "lidar", np.eye(4))
    told_ns = NS
    for k in range(1, 30):
        stamp_ns = NS + k * NS // 10
        climbed_s = max(0.0, k / 10 - 1.0)
        known_ns = stamp_ns - int((late_s if k % 4 in {2, 3} else 0.0) * NS)  # for two sweeps of four
        while told_ns <= known_ns:
            z_m = HEIGHT_M + CLIMB_M_S * max(0.0, told_ns / NS - 2.0)
            core.vehicle.poses.add(told_ns, (0.0, 0.0, z_m), (0.0, 0.0, 0.0, 1.0))
            told_ns += NS // 50
        points = over_ground(HEIGHT_M + CLIMB_M_S * climbed_s, seed=k)
        host.arrived_ns = stamp_ns
        finding = core.judged(Sweep(stamp_ns, points, np.zeros(len(points), np.float32)), "lidar").finding
        assert finding.ok, (k, finding.reason)


def test_a_frame_that_no_transform_tells_of_makes_the_lidar_unknown_until_it_is_told() -> None:
    host = RecordingHost()
    core = LidarObstacles(LidarSettings(), host)
    core.vehicle.set_mount("base_link", "lidar", np.eye(4))

    def finding(k, frame):
        points = over_ground(HEIGHT_M, seed=k)
        host.arrived_ns = NS + k * NS // 10
        core.vehicle.poses.add(host.arrived_ns, (0.0, 0.0, HEIGHT_M), (0.0, 0.0, 0.0, 1.0))
        return core.judged(Sweep(host.arrived_ns, points, np.zeros(len(points), np.float32)), frame).finding

    strange = finding(1, "os_sensor")
    assert (strange.verdict, strange.fault) == (Verdict.UNKNOWN, FaultKind.CALIBRATION)
    assert "no transform from base_link to 'os_sensor' (known: ['lidar'])" in strange.reason
    assert "frame_id" in strange.reason
    assert finding(2, "lidar").ok


def in_a_yard(origin_m: np.ndarray, half_m: float, seed: int) -> np.ndarray:
    """Return what a sensor sees of level ground and of the four walls of a yard around the origin of the map."""
    azimuth, up = np.meshgrid(np.radians(np.arange(0.5, 360.0, 1.0)), np.radians(np.arange(-29.5, 30.0, 2.0)))
    ray = np.stack([np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up)], axis=-1).reshape(-1, 3)
    low, high = np.array([-half_m, -half_m, 0.0]), np.array([half_m, half_m, np.inf])
    ranges = np.min(np.where(ray > 0, high - origin_m, low - origin_m) / ray, axis=1)
    ranges += np.random.default_rng(seed).normal(0.0, 0.01, len(ray))
    return (ray * ranges[:, None]).astype(np.float32)


def go_round(sweep_at, count: int) -> list[Finding]:
    """Return the findings of sweeps on a circle of 2 m radius, 0.2 m from one to the next; ``sweep_at(k, origin_m)`` are their points."""
    host = RecordingHost()
    core = LidarObstacles(LidarSettings(), host)
    core.vehicle.set_mount("base_link", "lidar", np.eye(4))
    findings = []
    for k in range(count):
        host.arrived_ns = NS + k * NS // 10
        origin_m = np.array([2.0 * np.cos(0.1 * k), 2.0 * np.sin(0.1 * k), 1.5])
        core.vehicle.poses.add(host.arrived_ns, tuple(origin_m), (0.0, 0.0, 0.0, 1.0))
        points = sweep_at(k, origin_m).astype(np.float32)
        findings.append(core.judged(Sweep(host.arrived_ns, points, np.zeros(len(points), np.float32)), "lidar").finding)
    return findings


def test_a_mount_that_changed_at_once_is_good_again_4_m_from_there_once_walls_are_where_they_were() -> None:
    turn = Rotation.from_euler("z", 20, degrees=True).as_matrix()
    findings = go_round(lambda k, at_m: in_a_yard(at_m, 8.0, k) @ (turn if 20 <= k < 51 else np.eye(3)), 80)
    good = [finding.ok for finding in findings]
    assert good[:51] == [True] * 20 + [False] * 31
    assert all(good[65:])


def test_what_changed_at_once_is_unknown_where_nothing_is_in_view_that_was_before() -> None:
    """A yard's walls are 8 m away, then 60 m: farther than walls are looked for."""
    findings = go_round(lambda k, at_m: in_a_yard(at_m, 60.0 if k >= 20 else 8.0, k), 130)
    assert all(finding.ok for finding in findings[:20])
    assert {finding.verdict for finding in findings[20:115]} == {Verdict.BROKEN}
    assert {finding.verdict for finding in findings[125:]} == {Verdict.UNKNOWN}
    assert "from one sweep to the next, and too little is in view that was before: its mount" in findings[-1].reason
