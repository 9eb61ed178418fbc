"""Synthetic runs for the report's tests: worlds of boxes, bags with a few messages, events as the mission writes them."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import genpy
import numpy as np
import open3d as o3d
import rosbag
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from std_msgs.msg import String
from uav_msgs.msg import GuidanceState, MappingState, SensorHealth

from alula_testing.run_log import LIFT_OFF_S

Floats = NDArray[np.float64]
Box = tuple[Sequence[float], Sequence[float]]

_FACES = [
    (0, 1, 3),
    (0, 3, 2),
    (4, 7, 5),
    (4, 6, 7),
    (0, 4, 5),
    (0, 5, 1),
    (2, 3, 7),
    (2, 7, 6),
    (0, 2, 6),
    (0, 6, 4),
    (1, 5, 7),
    (1, 7, 3),
]


def mesh_of(boxes: Iterable[Box], ground: Box | None) -> tuple[Floats, NDArray[np.int64]]:
    """Return vertices and triangles of axis-aligned boxes and a flat ground."""
    vertices: list[Floats] = []
    triangles: list[NDArray[np.int64]] = []
    count = 0
    for low, high in boxes:
        corners = np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)], dtype=np.float64)
        vertices.append(corners)
        triangles.append(np.array(_FACES) + count)
        count += 8
    if ground is not None:
        (x0, y0), (x1, y1) = ground[0][:2], ground[1][:2]
        vertices.append(np.array([[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0]], dtype=np.float64))
        triangles.append(np.array([[0, 1, 2], [0, 2, 3]]) + count)
    return np.concatenate(vertices), np.concatenate(triangles)


def write_world(path: Path, boxes: Iterable[Box], ground: Box | None) -> None:
    """Write ``world.ply``."""
    vertices, triangles = mesh_of(boxes, ground)
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(triangles))
    assert o3d.io.write_triangle_mesh(str(path), mesh)


def write_map(path: Path, points: Floats) -> None:
    """Write ``map.ply``."""
    assert o3d.io.write_point_cloud(str(path), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)))


def path_through(places: Sequence[Sequence[float]], *, speed_m_s: float, start_s: float, rate_hz: float = 20.0) -> tuple[Floats, Floats]:
    """Return stamps (N,) and positions (N, 3) of a vehicle that goes through the places at constant speed."""
    corners = np.asarray(places, dtype=np.float64)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    duration_s = along[-1] / speed_m_s
    t_s = np.linspace(0.0, duration_s, round(duration_s * rate_hz) + 1)
    return t_s + start_s, np.stack([np.interp(t_s * speed_m_s, along, corners[:, axis]) for axis in range(3)], axis=1)


def write_bag(
    path: Path,
    *,
    poses: tuple[Floats, Floats] | None = None,
    states: Sequence[dict[str, Any] | str] = (),
    guidance: Sequence[dict[str, Any]] = (),
    map_points: int | None = None,
    health: Sequence[tuple[float, str]] = (),
    told: Sequence[tuple[float, str]] = (),
    cut_at: int | None = None,
) -> None:
    """Write a bag; with ``cut_at`` as a killed recorder leaves it: no index, and nothing behind so many bytes."""
    bag = rosbag.Bag(str(path), "w", chunk_threshold=4096)
    for t_s, position in zip(*poses, strict=True) if poses is not None else ():
        message = PoseStamped()
        message.header.stamp = genpy.Time.from_sec(t_s)
        message.pose.position.x, message.pose.position.y, message.pose.position.z = position
        bag.write("/sim/true_pose", message, message.header.stamp)
    for state in states:
        text = state if isinstance(state, str) else json.dumps(state)
        bag.write("/sim/state", String(text), genpy.Time.from_sec(LIFT_OFF_S))
    for values in guidance:
        stated = GuidanceState()
        stated.header.stamp = genpy.Time.from_sec(values["t_s"])
        stated.reference, stated.mode, stated.landed_state = (
            values.get("reference", "idle"),
            values.get("mode", "GUIDED"),
            values["landed_state"],
        )
        stated.armed, stated.position_enu_m.z = values.get("armed", False), values.get("height_m", 0.0)
        bag.write("/uav_guidance/state", stated, stated.header.stamp)
    for t_s, fault in health:
        said = SensorHealth(sensor="zed", ok=not fault, fault=fault, reason=f"it is {fault}" if fault else "")
        said.header.stamp = genpy.Time.from_sec(t_s)
        bag.write("/zed_depth/health", said, said.header.stamp)
    for t_s, words in told:
        bag.write("/uav_guidance/told", String(words), genpy.Time.from_sec(t_s))
    if map_points is not None:
        bag.write("/lidar_mapping/state", MappingState(points=map_points), genpy.Time.from_sec(LIFT_OFF_S))
    if cut_at is None:
        bag.close()
        return
    bag.flush()
    os.truncate(path, min(cut_at, path.stat().st_size))
    # Bag.close would write the index that a killed recorder never writes.
    bag._file.close()
