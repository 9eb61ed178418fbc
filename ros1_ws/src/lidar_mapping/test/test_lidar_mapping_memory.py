"""What keyframes saw that lie behind goes to a file: memory does not grow with the way, and nothing else changes."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from lidar_mapping import Keyframes, MappingSettings
from lidar_mapping.core import LidarMapping
from lidar_mapping.seen import HeldSeen, SeenFile, StoredSeen
from lidar_mapping.surface import BLOCK, flat_patches, join

HELD, POINTS, KEPT = 600_000, 8_000, 60_000
"""Bytes in memory, about six keyframes; points a keyframe has before they are thinned to voxels; points in all, until they are thinned."""
STAYS = "keyframes that lie behind stay in memory, which grows with the way: "


@pytest.fixture
def bounds(monkeypatch):
    def set_bounds(held=HELD, kept=KEPT) -> None:
        monkeypatch.setattr("lidar_mapping.keyframes.MOST_HELD", held)
        monkeypatch.setattr("lidar_mapping.keyframes.MOST_KEPT", kept)

    set_bounds()
    return set_bounds


def extended(frames, count) -> Keyframes:
    """Go on along a wall for so many keyframes, of which each sees 8 m and is 0.5 m on."""
    for k in range(len(frames.all), len(frames.all) + count):
        rng, pose = np.random.default_rng(k), np.eye(4)
        pose[0, 3] = 0.5 * k
        wall = np.stack([rng.uniform(0.5 * k, 0.5 * k + 8.0, POINTS), np.full(POINTS, 3.0), rng.uniform(0.0, 2.0, POINTS)], axis=1)
        frames.add(k, pose, wall)
    return frames


def along_a_wall(count, folder=None) -> Keyframes:
    return extended(Keyframes(voxel_m=0.08, limit=1000, folder=folder), count)


def assert_equal(some, others) -> None:
    assert len(some.all) == len(others.all)
    for one, other in zip(some.all, others.all, strict=True):
        assert np.array_equal(one.points_in_map(), other.points_in_map())
        assert np.array_equal(one.patches_in_map().points, other.patches_in_map().points)
        assert np.array_equal(one.patches_in_map().normals, other.patches_in_map().normals)


def test_twice_the_way_takes_the_same_memory(bounds, tmp_path) -> None:
    frames = along_a_wall(25, tmp_path)
    once = frames.nbytes
    extended(frames, 25)
    assert HELD - 120_000 < once <= HELD
    assert HELD - 120_000 < frames.nbytes <= HELD
    assert not frames.problem
    assert list(tmp_path.iterdir()) == [], "the file has no name: it is gone with the process"
    bounds(held=1 << 40)
    assert along_a_wall(50).nbytes > 5 * HELD


@pytest.mark.parametrize("kept", [60_000, 130_000, 1 << 40], ids=["thinned", "stored, then thinned", "never thinned"])
def test_what_is_read_back_is_what_was_seen(bounds, kept) -> None:
    bounds(kept=kept)
    stored = along_a_wall(40)
    bounds(held=1 << 40, kept=kept)
    assert_equal(stored, along_a_wall(40))


def test_a_place_that_lies_behind_is_registered_against_as_before(bounds) -> None:
    stored = along_a_wall(40)
    bounds(held=1 << 40)
    held = along_a_wall(40)
    for among in (None, slice(3, 9)):
        found, expected = (frames.surface(np.array([2.0, 0.0, 0.0]), 5.0, among=among) for frames in (stored, held))
        assert np.array_equal(found.points, expected.points)
        assert np.array_equal(found.normals, expected.normals)


def test_a_map_of_an_earlier_run_stays_in_memory_and_counts_for_itself(bounds) -> None:
    frames = Keyframes(voxel_m=0.08, limit=1000)
    known = along_a_wall(1).all[0]
    frames.adopt(known.points_in_map(), known.patches_in_map())
    extended(frames, 20)
    assert isinstance(frames.all[0].seen, HeldSeen)
    assert frames.nbytes > HELD - 120_000
    assert len(frames.surface(np.array([90.0, 0.0, 0.0]), 1.0).points) == len(known.seen.patches.points)


def test_what_has_neither_points_nor_patches_is_stored_too() -> None:
    thread = np.linspace([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 3, dtype=np.float32)
    for points in (thread, thread[:0]):
        stored = SeenFile().put(HeldSeen(points, join([])))
        assert isinstance(stored, StoredSeen)
        assert np.array_equal(stored.points, points)
        assert stored.patches.points.shape == stored.patches.normals.shape == (0, 3)


def test_where_there_is_no_folder_all_stays_in_memory(bounds, tmp_path) -> None:
    frames = along_a_wall(15, tmp_path / "nowhere")
    assert frames.problem.startswith(f"{STAYS}[Errno 2] No such file or directory: '{tmp_path}/nowhere/")
    assert frames.nbytes > HELD + 120_000
    bounds(held=1 << 40)
    assert_equal(frames, along_a_wall(15))


def test_a_full_disk_keeps_it_in_memory_until_there_is_room(bounds) -> None:
    full = Keyframes(voxel_m=0.08, limit=1000)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (250_000, limits[1]))  # a write beyond is refused as on a full disk, some of it done
    try:
        extended(full, 20)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert full.problem == f"{STAYS}[Errno 27] File too large"
    assert full.nbytes > 2 * HELD
    extended(full, 1)
    assert full.nbytes <= HELD
    bounds(held=1 << 40)
    assert_equal(full, along_a_wall(21))


def test_what_can_not_be_read_back_is_told_and_the_rest_stays(bounds) -> None:
    frames = along_a_wall(30)
    cut = frames.all[1].seen.offset + 12  # behind the second keyframe's first point
    os.ftruncate(frames._file._file.fileno(), cut)
    bounds(held=1 << 40)
    whole = along_a_wall(30)
    assert np.array_equal(frames.all[0].points_in_map(), whole.all[0].points_in_map())
    assert frames.surface(np.array([5.0, 0.0, 0.0]), 2.0, among=slice(4, 14)) is None
    assert len(frames.all[1].points_in_map()) == 0
    assert frames.problem == f"what a keyframe that lies behind saw is lost: the file ends before byte {cut}"
    assert len(frames.all[1].patches_in_map().points) == 0
    assert np.array_equal(frames.all[-1].points_in_map(), whole.all[-1].points_in_map())


def test_what_fails_with_the_file_is_told_once(tmp_path) -> None:
    told = []
    host = SimpleNamespace(warn=lambda about, text, **_how: told.append((about, text)), report=lambda *_what: None)
    core = LidarMapping(MappingSettings(resume=False, map_path=str(tmp_path / "map.ply")), host)
    frames = core._slam.keyframes
    assert frames._file._folder == tmp_path
    for problem in ("", "full", "full", "lost", "lost"):
        frames._file.problem = problem
        core._tell_what_lacks()
    assert told == [("storage", "full"), ("storage", "lost")]


HEAP = """
import ctypes, sys
from lidar_mapping import heap
libc = ctypes.CDLL(None)
libc.malloc.restype, libc.malloc.argtypes, libc.free.argtypes = ctypes.c_void_p, [ctypes.c_size_t], [ctypes.c_void_p]
class Info(ctypes.Structure):
    _fields_ = [(name, ctypes.c_size_t) for name in "arena ordblks smblks hblks hblkhd usmblks fsmblks uordblks fordblks keepcost".split()]
libc.mallinfo2.restype = Info
assert sys.argv[1] == "before" or heap.give_back()
libc.free(libc.malloc(16 * heap.LARGE_BYTES))
arrays = libc.mallinfo2().hblks
libc.malloc(2 * heap.LARGE_BYTES)
print(libc.mallinfo2().hblks - arrays)
"""


def own_blocks(when) -> int:
    """How many blocks of its own the system gives an array of 2 MiB, once one of 16 MiB has been freed."""
    return int(subprocess.run([sys.executable, "-c", HEAP, when], check=True, capture_output=True, text=True).stdout)


def test_a_large_array_goes_back_to_the_system() -> None:
    assert (own_blocks("before"), own_blocks("set")) == (0, 1)


def test_patches_found_block_by_block_are_those_found_at_once(monkeypatch) -> None:
    rng = np.random.default_rng(3)
    wall = np.stack([rng.uniform(0.0, 12.0, 3 * BLOCK), rng.normal(3.0, 0.01, 3 * BLOCK), rng.uniform(0.0, 3.0, 3 * BLOCK)], axis=1)
    sparse = rng.uniform(20.0, 30.0, (BLOCK // 8, 3)) * [1.0, 1.0, 0.0]
    cloud = np.vstack([wall, sparse])
    blocks = flat_patches(cloud, cloud)
    monkeypatch.setattr("lidar_mapping.surface.BLOCK", len(cloud))
    whole = flat_patches(cloud, cloud)
    assert len(whole.points) > 2 * BLOCK
    for one, other in ((blocks, whole), (flat_patches(cloud[:0], cloud), join([]))):
        assert np.array_equal(
            np.unique(np.hstack([one.points, one.normals]), axis=0), np.unique(np.hstack([other.points, other.normals]), axis=0)
        )
