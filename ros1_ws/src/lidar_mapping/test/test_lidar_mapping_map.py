"""Voxel map and files."""

from __future__ import annotations

import numpy as np
import open3d as o3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidar_mapping import VoxelMap, downsample, read_ply, write_ply

points_of = st.integers(0, 2**31).map(lambda seed: np.random.default_rng(seed).uniform(-3, 3, (200, 3)))


def slow_map(clouds, voxel_m) -> dict[tuple[int, ...], np.ndarray]:
    """The obvious way: a dictionary of lists."""
    cells: dict[tuple[int, ...], list[np.ndarray]] = {}
    for point in np.vstack(clouds):
        cells.setdefault(tuple(np.floor(point / voxel_m).astype(int)), []).append(point)
    return {key: np.mean(members, axis=0) for key, members in cells.items()}


@given(st.lists(points_of, min_size=1, max_size=4), st.sampled_from([0.1, 0.25, 1.0]))
@settings(max_examples=30)
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
    whole = path.read_bytes()
    for content in (whole[:-5], b"", b"\xff\xfe\n", b"ply\nformat ascii 1.0\nend_header\n", whole.replace(b"float z", b"float q")):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=r"map\.ply is no map: "):
            read_ply(path)
