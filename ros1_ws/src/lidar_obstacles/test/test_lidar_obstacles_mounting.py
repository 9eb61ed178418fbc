"""A LiDAR that is not mounted as it is told: known by the vehicle's own motion, and by where the ground is."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lidar_obstacles import MountCheck
from perception_core import NS, FaultKind, Finding, PoseBuffer, Sweep, Verdict
from uav_simulator.sensors.lidar import Lidar
from uav_simulator.sensors.mounts import LIDAR
from uav_simulator.sensors.pose_track import Pose, PoseTrack
from uav_simulator.world.config import find_world, load_world
from uav_simulator.world.parts import build_parts
from uav_simulator.world.scene import Scene

DATA = Path(os.environ.get("ALULA_DATA", Path(__file__).resolve().parents[5] / "shared" / "data")) / "lidar_kitti"
UP = np.eye(4)
ACROSS = np.array([[0.0, 0, 1, 0.1], [1, 0, 0, 0], [0, 1, 0, -0.15], [0, 0, 0, 1]])  # spins across the nose
CAUSES = ": /tf_static does not tell how it is mounted, or its driver has other axes"


def rays(rings: int, step_deg: float, low_deg: float, high_deg: float) -> np.ndarray:
    """Return the directions (N, 3) of a sensor's beams, ring after ring as its driver sends them."""
    elevation, azimuth = np.meshgrid(
        np.radians(np.linspace(low_deg, high_deg, rings)), np.radians(np.arange(0, 360, step_deg)), indexing="ij"
    )
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1).reshape(-1, 3)


RAYS = rays(32, 0.8, -30, 30)
DENSE = rays(64, 0.19, -24, 3)  # 121,000 a sweep, half of them on the ground nearby
HIGH, LOW = np.array([12.0, 5.0, np.inf]), np.array([-8.0, -7.0, 0.0])  # a yard's walls and its ground, in the map
TURNED = {
    "mirrored": np.diag([1.0, -1.0, 1.0]),
    "turned by 180 degrees": np.diag([-1.0, -1.0, 1.0]),
    "turned by 90 degrees to the right": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),  # its data are turned to the left
}
OVERTURNED = {"rolled": np.diag([1.0, -1.0, -1.0]), "pitched": np.diag([-1.0, 1.0, -1.0]), "mirrored": np.diag([1.0, 1.0, -1.0])}


def fly(way, *, mount=UP, turned=None, rate_hz=10.0, repeat_from=None, lost_from=None, beams=RAYS, box=(LOW, HIGH)) -> list[Finding]:
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
        ray = beams @ rotation.T
        ray[np.abs(ray) < 1e-9] = 1e-9
        ranges = np.min(np.where(ray > 0, box[1] - origin, box[0] - origin) / ray, axis=1) + rng.normal(0.0, 0.02, len(ray))
        seen = ranges < 60.0
        points = beams[seen] * ranges[seen, None]
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
    assert name in findings[first].reason
    assert first <= 20  # 3 m
    assert findings[-1].reason == f"by the vehicle's own motion the LiDAR is {name}{CAUSES}", "the turns tell it from others"


@pytest.mark.parametrize("name", OVERTURNED)
def test_an_overturned_sensor_can_not_be_judged_even_while_the_vehicle_stands(name) -> None:
    standing = [(0.0, 0.0, 0.0)] * 20
    findings = fly(standing, turned=OVERTURNED[name])
    assert {(finding.verdict, finding.fault) for finding in findings[10:]} == {(Verdict.UNKNOWN, FaultKind.CALIBRATION)}
    assert (
        findings[10].reason == "level surfaces above the LiDAR and none below: it is upside down, or there is a ceiling, and nothing below"
    )
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
    assert findings[-1].reason == f"by the vehicle's own motion the LiDAR is turned by 180 degrees or mirrored{CAUSES}"


@pytest.mark.parametrize("name", TURNED)
def test_a_dense_sensor_that_is_mirrored_or_turned_is_known_as_soon_as_a_sparse_one(name) -> None:
    assert {finding.verdict for finding in fly(FORTH + ROUND[::4], beams=DENSE)} == {Verdict.OK}
    findings = fly(FORTH + ROUND[::4], turned=TURNED[name], beams=DENSE)
    first = next(k for k, finding in enumerate(findings) if not finding.ok)
    assert findings[first].reason == f"by the vehicle's own motion the LiDAR is {name}{CAUSES}"
    assert first <= 20  # 3 m


def test_few_things_along_a_sideways_way_are_no_sensor_that_repeats_what_it_saw() -> None:
    """Between x = 18 and 30 m of the yard a dozen posts and walls are near, most cut out of ground and fence by the rings."""
    scene, mount = Scene(build_parts(load_world(find_world("yard")), 1)), np.eye(4)
    mount[:3, :3], mount[:3, 3] = LIDAR.matrix, LIDAR.translation
    for begin_m in np.arange(17.0, 19.0, 0.1):
        lidar, track, poses, check = Lidar(scene, 1, noise_m=0.02), PoseTrack(), PoseBuffer(), MountCheck()
        for tick in range(600):
            stamp_s, place, heading = 1.0 + 0.02 * tick, (float(begin_m) + 0.02 * tick, 14.0, 3.0), np.pi / 4.0
            track.add(Pose(stamp_s, place, (float(np.cos(heading)), 0.0, 0.0, float(np.sin(heading)))))
            poses.add(round(stamp_s * NS), place, (0.0, 0.0, float(np.sin(heading)), float(np.cos(heading))))
            if tick % 5 or tick < 10:
                continue
            points = lidar.scan(track, stamp_s - lidar.spec.period_s)
            start_ns = round((stamp_s - lidar.spec.period_s) * NS)
            sweep = Sweep(start_ns, np.column_stack([points[axis] for axis in "xyz"]), points["time"].copy())
            assert check.finding(sweep, mount, poses, self_m=0.85).verdict is not Verdict.BROKEN


def test_a_sensor_that_repeats_what_it_saw_is_frozen_also_where_most_walls_are_along_the_way() -> None:
    corridor = np.array([-13.0, -2.5, 0.0]), np.array([16.0, 2.5, 3.5])
    along = [(0.13 * k, 0.0, 0.0) for k in range(30)]
    assert {finding.verdict for finding in fly(along, beams=DENSE, box=corridor)} == {Verdict.OK}
    assert fly(along, repeat_from=5, beams=DENSE, box=corridor)[-1].fault is FaultKind.FROZEN


def test_a_dense_sensor_that_repeats_what_it_saw_with_noise_is_frozen() -> None:
    findings = fly(FORTH, repeat_from=5, beams=DENSE)
    first = next(k for k, finding in enumerate(findings) if not finding.ok)
    assert {(finding.verdict, finding.fault) for finding in findings[first:]} == {(Verdict.BROKEN, FaultKind.FROZEN)}
    assert first <= 25


OPEN = np.array([-1e3, -1e3, 0.0]), np.array([1e3, 1e3, np.inf])


def test_a_mount_that_can_not_be_judged_in_5_s_of_motion_is_unknown_until_walls_show_it() -> None:
    way = [(0.13 * k, 0.07 * k, 0.0) for k in range(90)]
    findings = fly(way, box=OPEN)
    first = next(k for k, finding in enumerate(findings) if not finding.ok)
    assert 50 <= first <= 80
    assert {(finding.verdict, finding.fault) for finding in findings[first:]} == {(Verdict.UNKNOWN, FaultKind.CALIBRATION)}
    assert findings[first].reason.endswith("too few walls and posts within 20 m, or ranges or poses that scatter")
    farther = fly([(0.13 * k, 0.07 * k, 0.0) for k in range(140)], box=(OPEN[0], np.array([32.0, 1e3, np.inf])))
    assert not farther[first].ok
    assert farther[-1].ok
    assert all(finding.ok for finding in fly(way[:1] * 90, box=OPEN)), "a vehicle that stands"


def test_a_mount_that_was_judged_once_stays_so_in_the_open() -> None:
    check, poses, rng = MountCheck(), PoseBuffer(keep_s=1e6), np.random.default_rng(1)
    for k in range(200):
        stamp_ns, origin = NS + k * NS // 10, np.array([0.13 * k, 0.0, 1.5])
        poses.add(stamp_ns, tuple(origin), (0.0, 0.0, 0.0, 1.0))
        low, high = (LOW, np.array([15.0, 5.0, np.inf])) if k < 30 else OPEN
        ranges = np.min(np.where(RAYS > 0, high - origin, low - origin) / np.where(RAYS == 0, 1e-9, RAYS), axis=1)
        points = RAYS * (ranges + rng.normal(0.0, 0.02, len(RAYS)))[:, None]
        sweep = Sweep(stamp_ns, points[ranges < 60.0].astype(np.float32), np.zeros(np.count_nonzero(ranges < 60.0), np.float32))
        assert check.finding(sweep, UP, poses, self_m=1.0).ok, k


CHANGES = {
    "not at all": lambda points: points,
    "1 m ahead": lambda points: points + np.array([1.0, 0.0, 0.0]),
    "0.5 m to the left": lambda points: points + np.array([0.0, 0.5, 0.0]),
    "turned by 15 degrees": lambda points: points @ Rotation.from_euler("z", 15, degrees=True).as_matrix(),
    "mirrored": lambda points: points * [1.0, -1.0, 1.0],
    "0.9 times": lambda points: 0.9 * points,
}


@pytest.mark.parametrize("name", CHANGES)
def test_after_a_sudden_change_only_a_sensor_as_before_is_back(name) -> None:
    """From 1.5 m along the way on all is changed; 4.4 m on it is as it was, but the last metres do not look like the first ones."""
    check, poses, rng, backs = MountCheck(), PoseBuffer(keep_s=1e6), np.random.default_rng(1), []
    for k in range(60):
        stamp_ns, origin = NS + k * NS // 10, np.array([0.13 * k, 0.07 * k, 1.5])
        poses.add(stamp_ns, tuple(origin), (0.0, 0.0, 0.0, 1.0))
        ranges = np.min(np.where(RAYS > 0, HIGH - origin, LOW - origin) / np.where(RAYS == 0, 1e-9, RAYS), axis=1)
        points = (RAYS * (ranges + rng.normal(0.0, 0.02, len(RAYS)))[:, None])[ranges < 60.0]
        points = CHANGES[name](points) if 10 <= k < 40 else points
        sweep = Sweep(stamp_ns, points.astype(np.float32), np.zeros(len(points), np.float32))
        check.hold(changed=k >= 10)
        check.finding(sweep, UP, poses, self_m=1.0)
        backs.append(check.back)
    assert not any(backs[:10])
    assert any(backs[10:40]) is (name == "not at all")
    assert backs[-1]
    check.hold(changed=False)
    assert not check.back


@pytest.mark.parametrize(
    ("good", "after", "apart_at_last"),
    [((LOW, HIGH), (LOW, HIGH), False), ((LOW, HIGH), OPEN, True), (OPEN, OPEN, True)],
    ids=["within its walls", "out in the open", "always in the open"],
)
def test_after_a_sudden_change_and_20_m_with_too_little_seen_before_it_none_can_tell(good, after, apart_at_last) -> None:
    """The vehicle goes round in the yard, 0.12 m from sweep to sweep; after the change its walls are there, or none."""
    check, poses, rng, apart = MountCheck(), PoseBuffer(keep_s=1e6), np.random.default_rng(1), []
    for k in range(190):
        stamp_ns, origin = NS + k * NS // 10, np.array([2.0 * np.cos(0.06 * k), 2.0 * np.sin(0.06 * k), 1.5])
        poses.add(stamp_ns, tuple(origin), (0.0, 0.0, 0.0, 1.0))
        low, high = after if k >= 10 else good
        ranges = np.min(np.where(RAYS > 0, high - origin, low - origin) / np.where(RAYS == 0, 1e-9, RAYS), axis=1)
        points = (RAYS * (ranges + rng.normal(0.0, 0.02, len(RAYS)))[:, None])[ranges < 60.0]
        check.hold(changed=k >= 10)
        check.finding(Sweep(stamp_ns, points.astype(np.float32), np.zeros(len(points), np.float32)), UP, poses, self_m=1.0)
        apart.append(check.apart)
    assert not any(apart[:170])  # 19.2 m, and up to 0.6 m from the look before
    assert apart[-1] is apart_at_last


def real(turned=None, *, repeated=False) -> list[Finding]:
    """Return what is said of three real sweeps of 124,000 points, 0.8 m apart; ``repeated``: the first one again, with 5 mm of noise."""
    ways = np.loadtxt(DATA / "T_first_scan.txt").reshape(-1, 3, 4)
    scans = [np.fromfile(path, np.float32).reshape(-1, 4)[:, :3] for path in sorted(DATA.glob("*.bin"))]
    poses, check, rng, found = PoseBuffer(keep_s=1e6), MountCheck(), np.random.default_rng(2), []
    for k, (scan, way) in enumerate(zip(scans, ways, strict=True)):
        poses.add(NS + k * NS // 2, tuple(way[:, 3] + [0.0, 0.0, 1.7]), Rotation.from_matrix(way[:, :3]).as_quat())
        points = scans[0] + rng.normal(0.0, 0.005, scans[0].shape) if repeated else scan @ (np.eye(3) if turned is None else turned).T
        found.append(
            check.finding(Sweep(NS + k * NS // 2, points.astype(np.float32), np.zeros(len(points), np.float32)), UP, poses, self_m=2.5)
        )
    return found


@pytest.mark.skipif(not DATA.exists(), reason=f"no real data at {DATA}: set ALULA_DATA")
def test_real_dense_sweeps_tell_a_turned_or_frozen_sensor_after_two_comparisons() -> None:
    assert {finding.verdict for finding in real()} == {Verdict.OK}
    for name in ("turned by 180 degrees", "turned by 90 degrees to the right"):
        assert name in real(TURNED[name])[-1].reason
    assert real(repeated=True)[-1].fault is FaultKind.FROZEN
