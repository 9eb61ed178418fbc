"""From a sweep to the obstacle ahead of the motion."""

from __future__ import annotations

import os
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lidar_obstacles import LidarAhead, LidarSettings
from perception_core import NS, PoseBuffer, Sweep, VehicleMotion
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


def ahead(cloud, poses, motion, **settings):
    return LidarAhead(LidarSettings(**settings).ahead).look(cloud, T_base_lidar=T_BASE_LIDAR, poses=poses, motion=motion)


def look(cloud, poses, motion):
    return ahead(cloud, poses, motion).nearest


@given(st.floats(-3.1, 3.1), st.floats(2.5, 10.0), st.integers(0, 1000))
@settings(max_examples=40)
def test_sideways_flight_sees_what_is_beside_the_nose_whatever_the_yaw(yaw, distance, seed) -> None:
    # base left = sensor x: the box is to the left, and the vehicle flies to its left.
    cloud = box_cloud((distance, 0.0, 0.0), seed=seed)
    cloud[:, [1, 2]] = cloud[:, [2, 1]]  # the cloud's ground is below: sensor y is up
    left = (-np.sin(yaw), np.cos(yaw), 0.0)
    found = look(sweep(cloud), crab(yaw), VehicleMotion(velocity_enu_m_s=tuple(0.8 * np.array(left))))
    assert found is not None
    assert found.distance_m == pytest.approx(distance - 0.25, abs=0.15)
    assert np.array(found.point_enu_m)[:2] @ np.array(left)[:2] == pytest.approx(found.distance_m, abs=0.1)
    right = VehicleMotion(velocity_enu_m_s=tuple(-0.8 * np.array(left)))
    assert look(sweep(cloud), crab(yaw), right) is None


@pytest.mark.parametrize("timeless", [0, 60, None])
def test_what_has_no_time_is_an_obstacle_all_the_same(timeless) -> None:
    cloud = box_cloud((6.0, 0.0, 0.0), seed=1)
    cloud[:, [1, 2]] = cloud[:, [2, 1]]
    times = np.linspace(-0.02, 0.02, len(cloud))
    times[:timeless] = np.nan  # none, the box's, or all
    found = look(sweep(cloud, times), crab(), VehicleMotion(velocity_enu_m_s=(0.0, 1.0, 0.0)))
    assert found is not None
    assert found.distance_m == pytest.approx(5.75, abs=0.15)


def test_own_returns_and_ground_are_no_obstacle() -> None:
    cloud = box_cloud((99.0, 0.0, 0.0), seed=3)[60:]
    cloud[:, [1, 2]] = cloud[:, [2, 1]]
    for target in ((0.0, 20.0, 3.0), (0.0, -20.0, 3.0), (20.0, 0.0, 3.0)):
        assert look(sweep(cloud), crab(), VehicleMotion(target_enu_m=target)) is None


def test_a_sweep_in_motion_is_measured_from_its_end() -> None:
    velocity = (0.0, 2.0, 0.0)
    times = np.linspace(0.0, 0.1, 50)
    wall = np.column_stack([6.0 - 2.0 * times, np.linspace(-0.3, 0.3, 50), np.linspace(-0.3, 0.3, 50)])
    found = look(sweep(wall, times), crab(velocity=velocity), VehicleMotion(velocity_enu_m_s=velocity))
    assert found is not None
    assert found.distance_m == pytest.approx(5.8, abs=0.01)


def test_where_the_lidar_does_not_look_is_unknown_and_not_free() -> None:
    rng = np.random.default_rng(5)
    # The scan plane is across the nose: nothing but the two sides, a floor of 30 degrees' width below, and no return from ahead.
    sides = np.column_stack([rng.choice([-6.0, 6.0], 500), rng.uniform(-2, 2, 500), rng.uniform(-1.5, 1.5, 500)])
    forward = ahead(sweep(sides), crab(), VehicleMotion(velocity_enu_m_s=(1.0, 0.0, 0.0)))
    assert forward.nearest is None
    assert forward.unknown == "the LiDAR does not look where the vehicle goes: 0 returns from there"
    assert ahead(sweep(sides), crab(), VehicleMotion(velocity_enu_m_s=(1.0, 0.0, 0.0)), min_ahead=0).unknown == ""
    assert ahead(sweep(sides), crab(), VehicleMotion(velocity_enu_m_s=(0.0, 1.0, 0.0))).nearest is not None


@pytest.mark.parametrize("distance_m", [1.15, 1.5, 3.0])
def test_what_is_just_outside_of_the_vehicle_is_an_obstacle(distance_m) -> None:
    rng = np.random.default_rng(6)
    pole = np.column_stack([distance_m + rng.normal(0, 0.01, 60), rng.uniform(-0.4, 0.4, 60), rng.normal(0, 0.02, 60)])
    found = look(sweep(pole), crab(), VehicleMotion(target_enu_m=(0.0, 20.0, 3.0)))
    assert found is not None
    assert found.distance_m == pytest.approx(distance_m, abs=0.05)


def test_where_returns_were_just_lost_is_unknown_also_when_an_obstacle_is_seen() -> None:
    rng = np.random.default_rng(8)
    # The vehicle flies to its left, which is the sensor's x: sector 18 of 36 begins there. Far walls on both sides.
    walls = np.column_stack([rng.choice([-20.0, 20.0], 900), rng.uniform(-9, 9, 900), rng.uniform(-5, 5, 900)])
    left, right = VehicleMotion(velocity_enu_m_s=(0.0, 1.0, 0.0)), VehicleMotion(velocity_enu_m_s=(0.0, -1.0, 0.0))
    looker = LidarAhead(LidarSettings().ahead)

    def look_with(gone_sectors, motion, points=walls):
        gone = np.zeros(36, dtype=np.bool_)
        gone[gone_sectors] = True
        return looker.look(sweep(points), T_base_lidar=T_BASE_LIDAR, poses=crab(), motion=motion, gone=gone)

    assert look_with([], left).unknown == ""
    for sector in (16, 17, 18, 19):
        assert look_with([sector], left).unknown == "the LiDAR has just lost its returns from where the vehicle goes"
    assert look_with([18], right).unknown == ""
    assert look_with([0], right).unknown != ""
    assert look_with([14, 21], left).unknown == ""
    box = np.array([5.0, 0.0, 0.0]) + rng.uniform(-0.2, 0.2, (30, 3))
    seen = look_with([18], left, np.vstack([walls, box]))
    assert seen.nearest is not None
    assert seen.unknown == "the LiDAR has just lost its returns from where the vehicle goes"


def yard(*, elevations_deg, columns=720, gap_deg=None) -> np.ndarray:
    """Return a sweep over flat ground 2 m below, within walls at 20 m on all sides, for a sensor whose x looks ahead; z up."""
    azimuth, elevation = (grid.ravel() for grid in np.meshgrid(np.arange(columns) * 360.0 / columns - 180.0, elevations_deg))
    if gap_deg is not None:
        seen = (azimuth < gap_deg[0]) | (azimuth > gap_deg[1])
        azimuth, elevation = azimuth[seen], elevation[seen]
    a, e = np.radians(azimuth), np.radians(elevation)
    ray = np.column_stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    with np.errstate(divide="ignore"):
        ranges = np.minimum(np.where(ray[:, 2] < 0, -2.0 / ray[:, 2], np.inf), 20.0 / np.abs(ray[:, :2]).max(axis=1))
    return ray * ranges[:, None]


def forward(points) -> str:
    looker, motion = LidarAhead(LidarSettings().ahead), VehicleMotion(velocity_enu_m_s=(1.0, 0.0, 0.0))
    ahead = looker.look(sweep(points), T_base_lidar=np.eye(4), poses=crab(position=(0.0, 0.0, 2.0)), motion=motion)
    assert ahead.nearest is None
    return ahead.unknown


RINGS = np.linspace(-15.0, 15.0, 16)


@pytest.mark.parametrize("rings_deg", [RINGS, [-4.8, -1.6, 1.6, 4.8], np.linspace(-25, 15, 32)])
def test_a_way_that_is_seen_is_free(rings_deg) -> None:
    assert forward(yard(elevations_deg=rings_deg)) == ""


@pytest.mark.parametrize("begin_deg", [-10.0, -7.0, -5.0, -1.0, 0.0])
def test_a_gap_that_was_there_from_the_start_is_unknown(begin_deg) -> None:
    assert "does not see all of the way ahead: 0 returns from" in forward(yard(elevations_deg=RINGS, gap_deg=(begin_deg, begin_deg + 10.0)))


def test_a_gap_is_unknown_also_when_something_is_seen_beside_it() -> None:
    """A post 2.3 m ahead is in the gap; what is seen is a thing at the corridor's edge, 6 m ahead."""
    full = yard(elevations_deg=RINGS)
    azimuth_deg = np.degrees(np.arctan2(full[:, 1], full[:, 0]))
    rng = np.random.default_rng(4)
    edge = np.array([6.0, 1.6, 0.0]) + rng.uniform(-0.2, 0.2, (60, 3)) * [1.0, 2.5, 1.0]
    gapped = np.vstack([full[(azimuth_deg < -12.0) | (azimuth_deg > 13.0)], edge])
    motion = VehicleMotion(velocity_enu_m_s=(1.0, 0.0, 0.0))

    def forwards(points):
        return LidarAhead(LidarSettings().ahead).look(
            sweep(points), T_base_lidar=np.eye(4), poses=crab(position=(0.0, 0.0, 2.0)), motion=motion
        )

    seen = forwards(gapped)
    assert seen.nearest is not None
    assert seen.nearest.distance_m == pytest.approx(6.0, abs=0.2)
    assert seen.unknown == "the LiDAR does not look where the vehicle goes: 0 returns from there"
    whole = forwards(np.vstack([full, edge]))
    assert whole.nearest is not None
    assert whole.unknown == "", "an obstacle alone makes nothing unknown"


@pytest.mark.parametrize("count", [60, 240])
def test_a_sweep_too_thin_to_show_an_obstacle_is_unknown(count) -> None:
    full = yard(elevations_deg=np.linspace(-25, 15, 128), columns=1024)
    assert "the LiDAR does not" in forward(full[np.random.default_rng(count).permutation(len(full))[:count]])


@pytest.mark.parametrize("rings_deg", [[0.0], np.linspace(2.0, 88.0, 32)])
def test_a_sensor_that_does_not_look_down_to_the_corridor_calls_nothing_free(rings_deg) -> None:
    assert forward(yard(elevations_deg=rings_deg)) == "the LiDAR does not look down to the way ahead: 0 returns from so low"


ROOT = Path(__file__).resolve().parents[4]
KITTI = Path(os.environ.get("ALULA_DATA", ROOT.parent / "shared" / "data")) / "lidar_kitti"


def by_trying_all(points, towards_deg, settings) -> float | None:
    """Return the distance of the nearest obstacle: try each block of two by two by two cells, the nearest first, by its points alone."""
    turn = np.radians(towards_deg)
    ahead, left = points[:, 0] * np.cos(turn) + points[:, 1] * np.sin(turn), points[:, 1] * np.cos(turn) - points[:, 0] * np.sin(turn)
    up = points[:, 2]
    own = (np.hypot(points[:, 0], points[:, 1]) <= settings.body_radius_m) & (np.abs(up) <= settings.body_half_height_m)
    flat_m = np.hypot(ahead, left)
    level = (ahead >= 0.0) & (np.abs(left) <= np.tan(np.radians(10.0)) * ahead) & (np.abs(up) <= np.tan(np.radians(15.0)) * flat_m)
    at_1_m = 0.02 * np.count_nonzero(level & ~own & (np.linalg.norm(points, axis=1) >= 0.05))
    inside = (ahead >= settings.near_m) & (ahead <= settings.length_m) & (np.abs(left) <= settings.half_width_m)
    inside &= (np.abs(up) <= settings.half_height_m) & ~own
    ahead, left, up = ahead[inside], left[inside], up[inside]
    cell = settings.cell_m
    for row in range(int(settings.length_m / cell) + 1):
        found = []
        for column, layer in product(range(int(2 * settings.half_width_m / cell) + 1), range(int(2 * settings.half_height_m / cell) + 1)):
            low = (settings.near_m + row * cell, -settings.half_width_m + column * cell, -settings.half_height_m + layer * cell)
            block = np.all([(a >= b) & (a < b + 2 * cell) for a, b in zip((ahead, left, up), low, strict=True)], axis=0)
            found.append(ahead[block])
        most = max(found, key=len)
        if len(most) >= max(settings.min_points, at_1_m / max(settings.near_m + (row + 1) * cell, 1.0) ** 2):
            return float(np.percentile(most, 10.0))
    return None


@pytest.mark.skipif(not KITTI.exists(), reason=f"no real data at {KITTI}: set ALULA_DATA")
@pytest.mark.parametrize("scan", ["000000", "000001", "000002"])
def test_obstacles_of_a_real_street_are_where_trying_all_finds_them(scan) -> None:
    """54 directions in all, seen from 1.73 m above the road: none is missed, none is more than 1.2 cm off."""
    points = np.fromfile(KITTI / f"{scan}.bin", np.float32).reshape(-1, 4)[:, :3]
    settings = LidarSettings(length_m=30.0)
    found: list[tuple[float | None, float | None]] = []
    for towards_deg in range(0, 360, 20):
        turn = np.radians(towards_deg)
        motion = VehicleMotion(velocity_enu_m_s=(float(np.cos(turn)), float(np.sin(turn)), 0.0))
        seen = LidarAhead(settings.ahead).look(sweep(points), T_base_lidar=np.eye(4), poses=crab(position=(0.0, 0.0, 1.73)), motion=motion)
        found.append(
            (None if seen.nearest is None else seen.nearest.distance_m, by_trying_all(points.astype(float), towards_deg, settings))
        )
    assert sum(right is not None for _, right in found) >= 6
    for distance_m, right in found:
        assert distance_m == (right if right is None else pytest.approx(right, abs=0.012)), found


@pytest.mark.skipif(not KITTI.exists(), reason=f"no real data at {KITTI}: set ALULA_DATA")
@pytest.mark.parametrize("scan", ["000000", "000001", "000002"])
def test_what_a_lost_part_of_a_real_street_hides_is_not_told_as_free(scan) -> None:
    """25 degrees ahead are lost: an obstacle that was there is told where it was, or the way as unknown."""
    points = np.fromfile(KITTI / f"{scan}.bin", np.float32).reshape(-1, 4)[:, :3]
    azimuth_deg, hidden = np.degrees(np.arctan2(points[:, 1], points[:, 0])), 0
    for towards_deg in range(0, 360, 20):
        aside_deg = (azimuth_deg - towards_deg + 180.0) % 360.0 - 180.0
        turn = np.radians(towards_deg)
        motion = VehicleMotion(velocity_enu_m_s=(float(np.cos(turn)), float(np.sin(turn)), 0.0))
        whole, cut = (
            LidarAhead(LidarSettings(length_m=30.0).ahead).look(
                sweep(seen), T_base_lidar=np.eye(4), poses=crab(position=(0.0, 0.0, 1.73)), motion=motion
            )
            for seen in (points, points[(aside_deg < -12.0) | (aside_deg > 13.0)])
        )
        if whole.nearest is not None and (cut.nearest is None or cut.nearest.distance_m > whole.nearest.distance_m + 0.5):
            hidden += 1
            assert cut.unknown, (towards_deg, whole.nearest, cut.nearest)
    assert hidden >= 2


def dense_street(drops: int, seed: int) -> np.ndarray:
    """Return a sweep of 120,000 returns of ground 1.8 m below and of walls 8 m aside, but for drops between 1.5 and 15 m; sensor axes."""
    rng = np.random.default_rng(seed)
    azimuth, up = rng.uniform(-np.pi, np.pi, 120_000), np.radians(rng.uniform(-25.0, 2.0, 120_000))
    ranges = np.minimum(8.0 / np.maximum(np.abs(np.sin(azimuth)), 0.1) / np.cos(up), 1.8 / np.maximum(np.sin(-up), 0.02))
    ranges[:drops] = np.minimum(ranges[:drops], rng.uniform(1.5, 15.0, drops))
    way = np.column_stack([np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up)]) * ranges[:, None]
    return (way @ T_BASE_LIDAR[:3, :3]).astype(np.float32)


def dome(cloud: np.ndarray, seed: int) -> np.ndarray:
    """Return a sweep of a sensor that sees as densely up to 60 degrees above and below, where its own cloud ends; sensor axes."""
    rng = np.random.default_rng(seed)
    up = np.radians(np.concatenate([rng.uniform(2.0, 60.0, 260_000), rng.uniform(-60.0, -25.0, 155_000)]))
    azimuth = rng.uniform(-np.pi, np.pi, len(up))
    ranges = np.where(up > 0.0, 30.0, 1.8 / np.sin(np.abs(up)))
    way = np.column_stack([np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up)]) * ranges[:, None]
    return np.concatenate([cloud, (way @ T_BASE_LIDAR[:3, :3]).astype(np.float32)])


def with_post(cloud: np.ndarray, across_m: float, away_m: float) -> np.ndarray:
    """Return a sweep with an upright post straight ahead."""
    x, y, _ = T_BASE_LIDAR[:3, :3] @ cloud.T
    hit = (np.abs(y) < across_m / 2 / away_m * x) & (x > away_m)
    return np.where(hit[:, None], cloud * (away_m / np.where(hit, x, 1.0))[:, None], cloud).astype(np.float32)


@pytest.mark.parametrize("drops", [600, 1_200])  # of more the health tells
def test_rain_is_no_obstacle_to_a_dense_sensor(drops) -> None:
    forwards = VehicleMotion(velocity_enu_m_s=(1.0, 0.0, 0.0))
    assert [look(sweep(dense_street(drops, seed)), crab(), forwards) for seed in range(6)] == [None] * 6


@pytest.mark.parametrize("around", [False, True], ids=["street", "dome"])
@pytest.mark.parametrize(("across_m", "away_m"), [(0.01, 2.0), (0.05, 4.0), (0.05, 8.0), (0.1, 10.0)])
def test_a_post_is_an_obstacle_to_a_dense_sensor(across_m, away_m, around) -> None:
    cloud = with_post(dense_street(0, 0), across_m, away_m)
    found = look(sweep(dome(cloud, 0) if around else cloud), crab(), VehicleMotion(velocity_enu_m_s=(1.0, 0.0, 0.0)))
    assert found is not None
    assert found.distance_m == pytest.approx(away_m, abs=0.1)


def in_dust(cloud: np.ndarray, share: float, seed: int, *, half_deg: float = 30.0) -> np.ndarray:
    """Return a sweep with a share of the rays ahead ended between 3 and 6 m, or before what is nearer."""
    rng = np.random.default_rng([seed, 1])
    way = cloud @ T_BASE_LIDAR[:3, :3].T
    ranges, dust = np.linalg.norm(way, axis=1), rng.uniform(3.0, 6.0, len(way))
    hit = (rng.random(len(way)) < share) & (np.abs(np.degrees(np.arctan2(way[:, 1], way[:, 0]))) < half_deg) & (dust < ranges)
    return np.where(hit[:, None], cloud * (dust / ranges)[:, None], cloud).astype(np.float32)


@pytest.mark.parametrize("share", [0.1, 0.3])
@pytest.mark.parametrize("half_deg", [6.0, 30.0])
def test_dust_ahead_is_no_obstacle_and_no_free_way(share, half_deg) -> None:
    forwards = VehicleMotion(velocity_enu_m_s=(1.0, 0.0, 0.0))
    for seed in range(4):
        found = ahead(sweep(in_dust(dense_street(0, seed), share, seed, half_deg=half_deg)), crab(), forwards)
        assert found.nearest is None
        assert "m ahead stand alone in the air: rain, dust or snow" in found.unknown


def test_what_is_solid_is_an_obstacle_also_in_dust() -> None:
    forwards = VehicleMotion(velocity_enu_m_s=(1.0, 0.0, 0.0))
    found = ahead(sweep(in_dust(with_post(dense_street(0, 0), 0.6, 5.0), 0.3, 0)), crab(), forwards)
    assert found.nearest is not None
    assert found.nearest.distance_m == pytest.approx(5.0, abs=0.2)
    assert found.unknown
