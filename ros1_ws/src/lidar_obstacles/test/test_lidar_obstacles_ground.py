"""The ground under slopes, boxes, ghosts and cables; and on real scans, when they are at hand."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidar_obstacles import GroundModel, GroundSettings, LidarAhead, LidarSettings
from perception_core import NS, PoseBuffer, Sweep, VehicleMotion
from perception_core.corridor import corridor_coordinates

ROOT = Path(__file__).resolve().parents[4]
KITTI = Path(os.environ.get("ALULA_DATA", ROOT.parent / "shared" / "data")) / "lidar_kitti"
EAST = np.array([1.0, 0.0, 0.0])


def slope(angle_deg, *, seed=0, height_m=0.5, noise_m=0.02, count=20_000) -> np.ndarray:
    """Return ground that rises ahead of the vehicle, which is ``height_m`` above it, in the map whose 0 is under the vehicle."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform([-6.0, -6.0], [14.0, 6.0], (count, 2))
    xy = xy[np.hypot(xy[:, 0], xy[:, 1]) > 1.5]
    rise = np.tan(np.radians(angle_deg)) * np.maximum(xy[:, 0], 0.0)
    return np.column_stack([xy, rise + rng.normal(0.0, noise_m, len(xy))])


def box(x, y, *, width_m, height_m, ground_m=0.0, seed=0) -> np.ndarray:
    """Return the front and the top of a box whose front is at x."""
    rng = np.random.default_rng(seed)
    front = np.column_stack([np.full(60, x), rng.uniform(y - width_m / 2, y + width_m / 2, 60), rng.uniform(0, height_m, 60)])
    top = np.column_stack([rng.uniform(x, x + width_m, 60), rng.uniform(y - width_m / 2, y + width_m / 2, 60), np.full(60, height_m)])
    return np.vstack([front, top]) + np.array([0.0, 0.0, ground_m])


def look(points, *, height_m, speed=1.0, **changes):
    """Look ahead along east, from ``height_m`` above the map's 0, with a level LiDAR in base_link's origin."""
    poses = PoseBuffer()
    poses.add(NS, (0.0, 0.0, height_m), (0.0, 0.0, 0.0, 1.0))
    sweep = Sweep(NS, (points - [0.0, 0.0, height_m]).astype(np.float32), np.zeros(len(points), np.float32))
    ahead = LidarAhead(LidarSettings(**changes).ahead)
    return ahead.look(sweep, T_base_lidar=np.eye(4), poses=poses, motion=VehicleMotion(velocity_enu_m_s=(speed, 0.0, 0.0))).nearest


@pytest.mark.parametrize("angle_deg", [0.0, 2.0, 4.0, 6.0, 8.0])
@pytest.mark.parametrize("height_m", [0.5, 0.8, 1.7])
@pytest.mark.parametrize("seed", range(3))
def test_no_obstacle_on_slopes_up_to_8_degrees(angle_deg, height_m, seed) -> None:
    assert look(slope(angle_deg, seed=seed), height_m=height_m) is None


@given(st.floats(0.0, 8.0), st.floats(2.0, 11.0), st.floats(-0.9, 0.9), st.floats(0.35, 1.0), st.integers(0, 10_000))
@settings(max_examples=60)
def test_a_box_above_0_3_m_is_found_on_any_slope(angle_deg, x, y, size_m, seed) -> None:
    ground_m = float(np.tan(np.radians(angle_deg)) * x)
    points = np.vstack([slope(angle_deg, seed=seed), box(x, y, width_m=0.5, height_m=size_m, ground_m=ground_m, seed=seed)])
    found = look(points, height_m=ground_m + 0.5)
    assert found is not None
    assert found.distance_m == pytest.approx(x, abs=0.45)


def test_a_wall_is_not_taken_for_ground_however_long_it_is() -> None:
    rng = np.random.default_rng(1)
    wall = np.column_stack([rng.normal(6.0, 0.02, 4000), rng.uniform(-6, 6, 4000), rng.uniform(0, 4, 4000)])
    found = look(np.vstack([slope(0.0), wall]), height_m=1.5)
    assert found is not None
    assert found.distance_m == pytest.approx(6.0, abs=0.1)
    assert found.size_m[1] == pytest.approx(2.5, abs=0.2)  # as wide as the corridor


def test_ghosts_below_the_ground_make_no_obstacles() -> None:
    rng = np.random.default_rng(2)
    ghosts = np.column_stack([rng.uniform(2, 12, 5), rng.uniform(-2, 2, 5), rng.uniform(-6, -1, 5)])
    assert look(np.vstack([slope(4.0), ghosts]), height_m=0.5) is None


def test_a_cable_without_any_ground_in_view_is_an_obstacle() -> None:
    cable = np.column_stack([np.full(40, 5.0), np.linspace(-3, 3, 40), np.full(40, 3.0)])
    found = look(cable, height_m=3.0)
    assert found is not None
    assert found.distance_m == pytest.approx(5.0, abs=0.1)


def test_the_ground_is_remembered_where_it_rises_away_from_the_take_off() -> None:
    model = GroundModel(GroundSettings())
    for x in np.arange(0.0, 60.0, 0.5):  # up a hill of 8 degrees, half a metre above it
        origin = np.array([x, 0.0, np.tan(np.radians(8.0)) * x + 0.5])
        rng = np.random.default_rng(int(10 * x))
        xy = rng.uniform([x - 4, -4], [x + 12, 4], (4000, 2))
        ground = np.column_stack([xy, np.tan(np.radians(8.0)) * xy[:, 0] + rng.normal(0, 0.02, len(xy))])
        heights = model.heights(corridor_coordinates(ground, origin, EAST), np.arange(len(ground)), origin, EAST)
        assert heights.max() < 0.2


@pytest.mark.skipif(not KITTI.exists(), reason=f"no real data at {KITTI}: set ALULA_DATA")
@pytest.mark.parametrize("scan", ["000000", "000001", "000002"])
def test_a_real_road_is_free(scan) -> None:
    points = np.fromfile(KITTI / f"{scan}.bin", np.float32).reshape(-1, 4)[:, :3].astype(np.float64)
    in_map = points + np.array([0.0, 0.0, 1.73])  # the LiDAR is 1.73 m above the road, on a car whose mirrors and bonnet it sees
    assert look(in_map, height_m=1.73, half_height_m=1.7, body_radius_m=2.8, body_half_height_m=1.2) is None
    assert look(in_map, height_m=0.6, body_radius_m=2.8, body_half_height_m=1.2) is None
    pole = np.column_stack([np.full(10, 8.0), np.zeros(10), np.linspace(0.1, 0.4, 10)])
    found = look(np.vstack([in_map, pole]), height_m=0.6, body_radius_m=2.8, body_half_height_m=1.2)
    assert found is not None
    assert found.distance_m == pytest.approx(8.0, abs=0.1)
