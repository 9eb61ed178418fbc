"""A LiDAR that is not mounted as it is told: known by the vehicle's own motion, and by where the ground is."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lidar_obstacles import MountCheck
from perception_core import NS, FaultKind, Finding, PoseBuffer, Sweep, Verdict

UP = np.eye(4)
ACROSS = np.array([[0.0, 0, 1, 0.1], [1, 0, 0, 0], [0, 1, 0, -0.15], [0, 0, 0, 1]])  # spins across the nose
AZIMUTH, ELEVATION = (grid.ravel() for grid in np.meshgrid(np.radians(np.arange(0, 360, 0.8)), np.radians(np.linspace(-30, 30, 32))))
RAYS = np.column_stack([np.cos(ELEVATION) * np.cos(AZIMUTH), np.cos(ELEVATION) * np.sin(AZIMUTH), np.sin(ELEVATION)])
HIGH, LOW = np.array([12.0, 5.0, np.inf]), np.array([-8.0, -7.0, 0.0])  # a yard's walls and its ground, in the map
TURNED = {
    "mirrored": np.diag([1.0, -1.0, 1.0]),
    "turned by 180 degrees": np.diag([-1.0, -1.0, 1.0]),
    "turned by 90 degrees to the right": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),  # its data are turned to the left
}
OVERTURNED = {"rolled": np.diag([1.0, -1.0, -1.0]), "pitched": np.diag([-1.0, 1.0, -1.0]), "mirrored": np.diag([1.0, 1.0, -1.0])}


def fly(way, *, mount=UP, turned=None, rate_hz=10.0, repeat_from=None, lost_from=None) -> list[Finding]:
    """Return the findings of sweeps along a way of (x, y, yaw) in a yard, 1.5 m above the ground; the data are ``turned`` in base_link.

    From sweep ``repeat_from`` on the sensor repeats what it saw, in another order and with noise of 1 cm; from ``lost_from`` on no pose
    comes.
    """
    last = None
    poses, check, findings, rng = PoseBuffer(keep_s=1e6), MountCheck(), [], np.random.default_rng(1)
    for k, (x, y, yaw) in enumerate(way):
        stamp_ns = NS + int(k / rate_hz * NS)
        attitude = Rotation.from_euler("z", yaw)
        if lost_from is None or k < lost_from:
            poses.add(stamp_ns, (x, y, 1.5), attitude.as_quat())
        rotation, origin = attitude.as_matrix() @ mount[:3, :3], np.array([x, y, 1.5]) + attitude.as_matrix() @ mount[:3, 3]
        ray = RAYS @ rotation.T
        ray[np.abs(ray) < 1e-9] = 1e-9
        ranges = np.min(np.where(ray > 0, HIGH - origin, LOW - origin) / ray, axis=1) + rng.normal(0.0, 0.02, len(ray))
        seen = ranges < 60.0
        points = RAYS[seen] * ranges[seen, None]
        if turned is not None:
            points = points @ (mount[:3, :3].T @ turned @ mount[:3, :3]).T
        if repeat_from is not None and k >= repeat_from and last is not None:
            points = rng.permutation(last) + rng.normal(0.0, 0.01, last.shape)
        else:
            last = points
        sweep = Sweep(stamp_ns, points.astype(np.float32), np.zeros(len(points), np.float32))
        findings.append(check.finding(sweep, mount, poses, self_m=1.0))
    return findings


FORTH = [(0.13 * k, 0.07 * k, 0.0) for k in range(30)]  # along no wall
ROUND = [(3.9, 2.1, np.radians(4.5) * k) for k in range(40)]


@pytest.mark.parametrize("mount", [UP, ACROSS], ids=["level", "across"])
def test_a_sensor_that_is_mounted_as_told_is_good(mount) -> None:
    assert {finding.verdict for finding in fly(FORTH + ROUND, mount=mount)} == {Verdict.OK}


@pytest.mark.parametrize("name", TURNED)
@pytest.mark.parametrize("mount", [UP, ACROSS], ids=["level", "across"])
def test_a_mirrored_or_turned_sensor_is_broken_as_soon_as_motion_shows_it(name, mount) -> None:
    findings = fly(FORTH + ROUND, mount=mount, turned=TURNED[name])
    first = next(k for k, finding in enumerate(findings) if not finding.ok)
    assert {(finding.verdict, finding.fault) for finding in findings[first:]} == {(Verdict.BROKEN, FaultKind.CALIBRATION)}
    assert findings[first].reason == f"by the vehicle's own motion the LiDAR is {name}"
    assert first <= 20  # 3 m


@pytest.mark.parametrize("name", OVERTURNED)
def test_an_overturned_sensor_can_not_be_judged_even_while_the_vehicle_stands(name) -> None:
    standing = [(0.0, 0.0, 0.0)] * 20
    findings = fly(standing, turned=OVERTURNED[name])
    assert {(finding.verdict, finding.fault) for finding in findings[10:]} == {(Verdict.UNKNOWN, FaultKind.CALIBRATION)}
    assert findings[10].reason == "level surfaces above the LiDAR and none below: is it upside down?"
    assert all(finding.ok for finding in fly(standing))


@pytest.mark.parametrize("turned", [OVERTURNED["rolled"], TURNED["mirrored"]], ids=["overturned", "mirrored"])
def test_what_was_found_stays_while_no_poses_come(turned) -> None:
    findings = fly(FORTH + ROUND, turned=turned, lost_from=45)
    assert not findings[44].ok
    assert set(findings[45:]) == {findings[44]}


def test_without_poses_nothing_is_said() -> None:
    check = MountCheck()
    sweep = Sweep(NS, (5.0 * RAYS).astype(np.float32), np.zeros(len(RAYS), np.float32))
    assert check.finding(sweep, UP, PoseBuffer(), self_m=1.0).ok
    nothing = Sweep(NS, np.full((50, 3), np.nan, np.float32), np.zeros(50, np.float32))
    poses = PoseBuffer()
    poses.add(NS, (0.0, 0.0, 1.5), (0.0, 0.0, 0.0, 1.0))
    assert check.finding(nothing, UP, poses, self_m=1.0).ok


@pytest.mark.parametrize("mount", [UP, ACROSS], ids=["level", "across"])
def test_a_sensor_that_repeats_what_it_saw_is_frozen_when_motion_shows_it(mount) -> None:
    findings = fly(FORTH + [(3.77 + 0.13 * k, 2.03 - 0.2 * k, 0.0) for k in range(30)], mount=mount, repeat_from=5)
    first = next(k for k, finding in enumerate(findings) if not finding.ok)
    assert {(finding.verdict, finding.fault) for finding in findings[first:]} == {(Verdict.BROKEN, FaultKind.FROZEN)}
    assert first <= 30  # 4 m
    assert "do not change with the vehicle's own motion" in findings[first].reason


def test_what_the_motion_does_not_tell_apart_is_told_together() -> None:
    findings = fly([(0.0, 0.13 * k, 0.0) for k in range(30)], turned=TURNED["turned by 180 degrees"])
    assert findings[-1].reason == "by the vehicle's own motion the LiDAR is turned by 180 degrees or mirrored"
