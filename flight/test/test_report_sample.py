"""Synthetic runs for the report's tests: worlds of boxes, bags with a few messages, events as the mission writes them."""

from __future__ import annotations

import json
import math
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

from alula.common.record import EVENTS, REPORTS, RecordWriter

Floats = NDArray[np.float64]
Box = tuple[Sequence[float], Sequence[float]]

LIFT_OFF_S = 12.0  # of mission clock in all samples: nothing may depend on it
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
        told = GuidanceState()
        told.header.stamp = genpy.Time.from_sec(values["t_s"])
        told.reference, told.mode, told.landed_state = values.get("reference", "idle"), values.get("mode", "GUIDED"), values["landed_state"]
        bag.write("/uav_guidance/state", told, told.header.stamp)
    for t_s, fault in health:
        said = SensorHealth(sensor="zed", ok=not fault, fault=fault, reason=f"it is {fault}" if fault else "")
        said.header.stamp = genpy.Time.from_sec(t_s)
        bag.write("/zed_depth/health", said, said.header.stamp)
    if map_points is not None:
        bag.write("/lidar_mapping/state", MappingState(points=map_points), genpy.Time.from_sec(LIFT_OFF_S))
    if cut_at is None:
        bag.close()
        return
    bag.flush()
    os.truncate(path, min(cut_at, path.stat().st_size))
    # Bag.close would write the index that a killed recorder never writes.
    bag._file.close()


class Log:
    """Events as the mission writes them, each numbered within its skillset, and reports to it."""

    def __init__(self) -> None:
        self.events: list[dict[str, Any]] = []
        self.reports: list[tuple[float, dict[str, Any]]] = []

    def _add(self, t_s: float, skillset: str, kind: str, **values: Any) -> None:
        self.events.append({"stamp_s": LIFT_OFF_S + t_s, "skillset": skillset, "kind": kind, **values})

    def skill(self, t_s: float, name: str, id_: str, state: str, **values: Any) -> None:
        """Add a change of an execution; ``name`` is skillset.skill, ``t_s`` counts from lift-off."""
        skillset, skill = name.split(".")
        self._add(t_s, skillset, "EXECUTION", skill=skill, id=id_, state=state, **values)

    def change(self, t_s: float, name: str, source: str, target: str, cause: str = "extern") -> None:
        """Add a transition; ``name`` is skillset.resource."""
        skillset, resource = name.split(".")
        self._add(t_s, skillset, "TRANSITION", resource=resource, from_state=source, to_state=target, cause=cause)

    def told(self, t_s: float, name: str, id_: str, state: str, message: str = "") -> None:
        """Add a report to the mission of an execution."""
        skillset, skill = name.split(".")
        self.reports.append((LIFT_OFF_S + t_s, {"skillset": skillset, "skill": skill, "id": id_, "state": state, "message": message}))

    def write(self, path: Path, *, until_s: float = math.inf) -> None:
        """Write ``skills.mcap`` in the order of time, as a mission that died at ``until_s`` leaves it."""
        ordered = sorted(self.events, key=lambda event: event["stamp_s"])
        numbers: dict[str, int] = {}
        for event in ordered:
            event["sequence"] = numbers[event["skillset"]] = numbers.get(event["skillset"], 0) + 1
        writer = RecordWriter(path)
        for event in ordered:
            if event["stamp_s"] < until_s:
                writer.write(EVENTS, round(event["stamp_s"] * 1e9), event)
        for stamp_s, report in self.reports:
            writer.write(REPORTS, round(stamp_s * 1e9), report)
        if until_s == math.inf:
            writer.close()


def failing_flight() -> Log:
    """Return the events of a flight that loses the ZED 30 s after lift-off, sees it after 0.25 s and flies on by LiDAR."""
    log = Log()
    for number, (begin_s, end_s) in enumerate([(5.0, 27.3), (27.5, 30.3)], start=1):
        target = {"target": {"x": 22.0, "y": 14.0 * (number - 1), "z": 3.0}, "speed": 1.0}
        log.skill(begin_s, "navigation.goto_straight", f"s{number}", "REQUESTED", inputs=target)
        log.skill(begin_s + 0.02, "navigation.goto_straight", f"s{number}", "RUNNING")
        state = {"state": "TERMINATED", "result": "ARRIVED"} if number == 1 else {"state": "INTERRUPTED"}
        log.skill(end_s, "navigation.goto_straight", f"s{number}", **state)
    log.skill(-1.2, "navigation.takeoff", "t1", "REQUESTED", inputs={"height": 3.0, "speed": 2.0})
    log.skill(-1.18, "navigation.takeoff", "t1", "RUNNING")
    log.skill(4.6, "navigation.takeoff", "t1", "TERMINATED", result="AT_ALTITUDE")
    log.change(0.0, "navigation.flight_status", "ON_GROUND", "IN_AIR")
    log.skill(4.7, "mapping.lidar_mapping", "m1", "REQUESTED")
    log.skill(4.72, "mapping.lidar_mapping", "m1", "RUNNING")
    log.change(4.72, "mapping.mapping_process", "IDLE", "RUNNING", "lidar_mapping m1 begin")
    log.skill(4.7, "perception.zed_depthmap", "z1", "REQUESTED")
    log.skill(4.75, "perception.zed_depthmap", "z1", "RUNNING")
    log.change(-3.0, "perception.zed_status", "UNKNOWN", "OK")
    log.change(-3.0, "perception.lidar_status", "UNKNOWN", "OK")
    log.change(30.25, "perception.zed_status", "OK", "BROKEN")
    unmet = {"name": "zed_works", "condition": "zed_status == OK", "reason": "", "states": {"zed_status": "BROKEN"}, "data": {}}
    violated = {"result": "zed_works", "message": "zed_status is BROKEN", "unmet": [unmet]}
    log.skill(30.25, "perception.zed_depthmap", "z1", "RESOURCE_INVARIANT_VIOLATED", **violated)
    log.skill(30.4, "perception.lidar_depthmap", "l1", "REQUESTED")
    log.skill(30.45, "perception.lidar_depthmap", "l1", "RUNNING")
    begin_s = 30.5
    for number, length_s in enumerate([12.0, 22.0, 18.0], start=1):
        log.skill(begin_s, "navigation.rotate_head", f"r{number}", "REQUESTED")
        log.skill(begin_s + 0.02, "navigation.rotate_head", f"r{number}", "RUNNING")
        log.skill(begin_s + 2.6, "navigation.rotate_head", f"r{number}", "TERMINATED", result="ALIGNED")
        log.skill(begin_s + 2.7, "navigation.lock_head", f"h{number}", "REQUESTED")
        log.skill(begin_s + 2.72, "navigation.lock_head", f"h{number}", "RUNNING")
        log.skill(begin_s + 2.9, "navigation.goto", f"g{number}", "REQUESTED")
        log.skill(begin_s + 2.92, "navigation.goto", f"g{number}", "RUNNING")
        log.skill(begin_s + 2.9 + length_s, "navigation.goto", f"g{number}", "TERMINATED", result="ARRIVED")
        log.skill(begin_s + 3.0 + length_s, "navigation.lock_head", f"h{number}", "INTERRUPTED")
        begin_s += 3.1 + length_s
    log.skill(begin_s, "mapping.lidar_mapping", "m1", "INTERRUPTED")
    log.change(begin_s, "mapping.mapping_process", "RUNNING", "IDLE", "lidar_mapping m1 finish")
    log.skill(begin_s, "perception.lidar_depthmap", "l1", "INTERRUPTED")
    log.skill(begin_s + 0.1, "navigation.land", "d1", "REQUESTED")
    log.skill(begin_s + 0.12, "navigation.land", "d1", "RUNNING")
    log.change(begin_s + 7.0, "navigation.flight_status", "IN_AIR", "ON_GROUND")
    log.skill(begin_s + 7.2, "navigation.land", "d1", "TERMINATED", result="LANDED")
    return log
