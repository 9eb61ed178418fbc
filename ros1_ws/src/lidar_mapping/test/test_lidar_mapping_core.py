"""Voxel map, registration (real pair of scans with its true transformation), the mapping procedure, files."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lidar_mapping import (
    Mapper,
    MapperSettings,
    RegistrationSettings,
    Surface,
    VoxelMap,
    downsample,
    read_ply,
    register,
    write_ply,
)
from perception_core import NS, PoseBuffer, PoseUnavailableError, Sweep

ROOT = Path(__file__).resolve().parents[4]
DATA = Path(os.environ.get("ALULA_DATA", ROOT.parent / "shared" / "data")) / "lidar_pair" / "data"
points_of = st.integers(0, 2**31).map(lambda seed: np.random.default_rng(seed).uniform(-3, 3, (200, 3)))


def slow_map(clouds, voxel_m) -> dict[tuple[int, ...], np.ndarray]:
    """The obvious way: a dictionary of lists."""
    cells: dict[tuple[int, ...], list[np.ndarray]] = {}
    for point in np.vstack(clouds):
        cells.setdefault(tuple(np.floor(point / voxel_m).astype(int)), []).append(point)
    return {key: np.mean(members, axis=0) for key, members in cells.items()}


@given(st.lists(points_of, min_size=1, max_size=4), st.sampled_from([0.1, 0.25, 1.0]))
@settings(max_examples=30, deadline=None)
def test_voxels_hold_the_means_that_the_obvious_way_finds(clouds, voxel_m) -> None:
    voxels = VoxelMap(voxel_m=voxel_m, max_voxels=10_000)
    new = sum(voxels.insert(cloud) for cloud in clouds)
    expected = slow_map(clouds, voxel_m)
    assert new == len(voxels) == len(expected)
    assert voxels.counts.sum() == sum(len(cloud) for cloud in clouds)
    for point in voxels.points:
        assert point == pytest.approx(expected[tuple(np.floor(point / voxel_m).astype(int))], abs=1e-9)
    assert len(downsample(np.vstack(clouds), voxel_m)) == len(expected)


def test_the_map_grows_past_its_first_capacity_and_stops_at_its_limit() -> None:
    grid = np.stack(np.meshgrid(*[np.arange(30) + 0.5] * 3), axis=-1).reshape(-1, 3).astype(float)
    voxels = VoxelMap(voxel_m=1.0, max_voxels=40_000)
    assert voxels.insert(grid) == 30**3
    assert voxels.insert(grid) == 0
    assert voxels.points == pytest.approx(grid[np.lexsort((grid[:, 2], grid[:, 1], grid[:, 0]))])
    assert voxels.insert(grid + 100.0) == 40_000 - 30**3
    assert voxels.full
    assert voxels.insert(grid + 200.0) == 0
    assert len(voxels) == 40_000


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e9])
def test_points_from_nowhere_are_refused_before_anything_changes(wrong) -> None:
    voxels = VoxelMap(voxel_m=0.1, max_voxels=100)
    with pytest.raises(ValueError, match="not finite or farther"):
        voxels.insert(np.array([[0.0, 0.0, 0.0], [wrong, 0.0, 0.0]]))
    assert len(voxels) == 0


@pytest.mark.skipif(not DATA.exists(), reason=f"no real data at {DATA}: set ALULA_DATA")
def test_two_real_scans_are_laid_onto_each_other() -> None:
    source, target = (downsample(np.asarray(o3d.io.read_point_cloud(str(DATA / f"{n}.ply")).points), 0.3) for n in ("source", "target"))
    truth = np.loadtxt(DATA / "T_target_source.txt")
    # 0.5 m and 0.7 degrees from where the odometry left it: farther than a flight's scans are, so the reach is wider.
    wide = RegistrationSettings(
        max_pair_m=1.0, kernel_m=0.1, iterations=40, max_correction_m=1.0, pose_sigma_m=1.0, pose_sigma_rad=0.1, effective_points=500.0
    )
    found = register(source, np.zeros(3), Surface(target, normal_radius_m=0.9, flat_m=0.08), wide)
    error = np.linalg.inv(truth) @ found.T_corrected_given
    assert found.believed, found.refusal
    assert np.linalg.norm(error[:3, 3]) < 0.03
    assert np.degrees(Rotation.from_matrix(error[:3, :3]).magnitude()) < 0.2


def room(seed, count=6000, *, bare=False) -> np.ndarray:
    """Points on the ground and the walls of a yard of 16 x 10 m; ``bare``: only ground and two parallel walls along x."""
    rng = np.random.default_rng(seed)
    x, y, z = rng.uniform(-8, 8, count), rng.uniform(-5, 5, count), rng.uniform(0, 4, count)
    zero = np.zeros(count)
    planes = [np.stack(p, axis=1) for p in ((x, y, zero), (x, zero - 5, z), (x, zero + 5, z), (zero - 8, y, z), (zero + 8, y, z))]
    chosen = planes[:3] if bare else planes
    return np.vstack(chosen) + rng.normal(0.0, 0.01, (count * len(chosen), 3))


@given(st.tuples(*[st.floats(-0.1, 0.1)] * 3), st.tuples(*[st.floats(-0.02, 0.02)] * 3))
@settings(max_examples=15, deadline=None)
def test_a_wrong_pose_is_corrected(shift, turn) -> None:
    surface = Surface(downsample(room(1), 0.3), normal_radius_m=0.6, flat_m=0.05)
    around = np.array([1.0, 2.0, 3.0])
    points = downsample(room(2), 0.3)
    rotation = Rotation.from_rotvec(turn).as_matrix()
    wrong = (points - around) @ rotation.T + around + shift
    firm = RegistrationSettings(effective_points=2000.0)
    found = register(wrong, around, surface, firm)
    corrected = wrong @ found.T_corrected_given[:3, :3].T + found.T_corrected_given[:3, 3]
    assert found.believed, found.refusal
    assert np.abs(corrected - points).max() < 0.06
    assert found.correction_m == pytest.approx(np.linalg.norm(shift), abs=0.05)


def test_along_bare_walls_the_pose_is_left_as_it_was_given() -> None:
    surface = Surface(downsample(room(1, bare=True), 0.3), normal_radius_m=0.6, flat_m=0.05)
    points = downsample(room(2, bare=True), 0.3) + np.array([0.1, 0.1, 0.0])
    firm = RegistrationSettings(effective_points=100.0)
    shift = register(points, np.array([0.0, 0.0, 2.0]), surface, firm).T_corrected_given[:3, 3]
    assert abs(shift[0]) < 0.02
    assert shift[1] == pytest.approx(-0.1, abs=0.02)


def test_what_can_not_be_believed_says_why() -> None:
    surface = Surface(downsample(room(1), 0.3), normal_radius_m=0.6, flat_m=0.05)
    points, centre = downsample(room(2), 0.3), np.array([0.0, 0.0, 2.0])
    assert "too few" in register(points[:50], centre, surface, RegistrationSettings()).refusal
    assert "fitness 0.0" in register(points + np.array([0.0, 0.0, 50.0]), centre, surface, RegistrationSettings()).refusal
    loose = RegistrationSettings(effective_points=2000.0, pose_sigma_m=1.0)
    far = register(points + np.array([0.2, 0.2, 0.0]), centre, surface, replace(loose, max_correction_m=0.1))
    assert "beyond 0.1 m" in far.refusal
    c, s = np.cos(0.03), np.sin(0.03)
    turned = points @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
    assert "rad is beyond" in register(turned, centre, surface, replace(loose, pose_sigma_rad=1.0, max_correction_rad=0.01)).refusal


class Flight:
    """A vehicle at rest in the yard whose given pose is off by 3 cm and 0.5 degrees, anew for each scan."""

    def __init__(self) -> None:
        self.rng, self.poses, self.now = np.random.default_rng(5), PoseBuffer(), 100 * NS

    def sweep(self) -> Sweep:
        self.now += NS // 10
        turn = Rotation.from_rotvec(self.rng.normal(0.0, np.radians(0.5), 3))
        position = np.array([0.0, 0.0, 2.0])
        for _ in range(2):
            self.poses.add(self.now, tuple(position + self.rng.normal(0.0, 0.03, 3)), turn.as_quat())
        seen = room(self.rng.integers(1 << 31), count=1500) - position
        own = self.rng.uniform(-0.6, 0.6, (100, 3))
        return Sweep(self.now, np.vstack([seen, own]).astype(np.float32), np.zeros(len(seen) + 100, np.float32))


def off_the_room(points) -> np.ndarray:
    x, y, z = points.T
    return np.min(np.abs([z, y - 5, y + 5, x - 8, x + 8]), axis=0)


def test_a_map_from_noisy_poses_is_within_six_centimetres_and_better_than_the_poses_alone() -> None:
    rmse = {}
    for name, warm_up in (("registered", 5), ("poses alone", 10_000)):
        flight, mapper = Flight(), Mapper(replace(MapperSettings(), warm_up_scans=warm_up))
        for _ in range(25):
            mapper.add(flight.sweep(), flight.poses, np.eye(4))
        assert mapper.count.scans == 25
        assert np.linalg.norm(mapper.map.points - [0.0, 0.0, 2.0], axis=1).min() > 1.1  # the vehicle itself is not in the map
        rmse[name] = float(np.sqrt(np.mean(off_the_room(mapper.map.points) ** 2)))
    assert rmse["registered"] < 0.06
    assert rmse["registered"] < 0.8 * rmse["poses alone"]


def test_a_sweep_without_pose_changes_nothing() -> None:
    mapper = Mapper(MapperSettings())
    with pytest.raises(PoseUnavailableError):
        mapper.add(Flight().sweep(), PoseBuffer(), np.eye(4))
    assert (len(mapper.map), mapper.count.scans) == (0, 0)


def test_files_are_whole_and_come_back(tmp_path) -> None:
    path = tmp_path / "map.ply"
    points = np.random.default_rng(1).uniform(-50, 50, (1000, 3))
    write_ply(path, points[:10])
    write_ply(path, points)
    assert read_ply(path) == pytest.approx(points, abs=1e-5)
    assert np.asarray(o3d.io.read_point_cloud(str(path)).points) == pytest.approx(points, abs=1e-5)
    assert [entry.name for entry in tmp_path.iterdir()] == ["map.ply"]
    with pytest.raises(OSError, match="nowhere"):
        write_ply(tmp_path / "nowhere" / "map.ply", points)
    path.write_bytes(path.read_bytes()[:-5])
    with pytest.raises(ValueError, match="not a map of ours"):
        read_ply(path)
