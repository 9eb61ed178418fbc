"""The records of a run as the stack leaves them, for the console's tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from alula_common.record import DATA, EVENTS, FILE, MISSION, TREE, RecordWriter

LIFT_OFF_S = 12.0
HOSTILE = "<img src=x onerror=\"document.title='owned'\"></script><script>document.title='owned'</script>"


def node(name: str, kind: str, status: str, *children: dict[str, Any], message: str = "", skill: str = "") -> dict[str, Any]:
    return {"name": name, "kind": kind, "status": status, "message": message, "skill": skill, "children": list(children)}


def tree(watch: str, fallback: str, *, name: str = "navigate") -> dict[str, Any]:
    zed = node("watch with the ZED", "skill", watch, message="zed_ok" if watch == "FAILURE" else "", skill="perception.zed_depthmap")
    first = node("ZED navigation", "parallel", watch, zed)
    lidar = node("watch with the LiDAR", "skill", fallback, skill="perception.lidar_depthmap")
    second = node("LiDAR navigation", "sequence", fallback, lidar)
    return node(name, "selector", "RUNNING", first, second)


def execution(skill: str, state: str, number: int, *, result: str = "", message: str = "") -> dict[str, Any]:
    skillset, _, short = skill.partition(".")
    identity = {"skillset": skillset, "sequence": number, "kind": "EXECUTION", "skill": short, "id": short[:6]}
    return {**identity, "state": state, "result": result, "message": message, "inputs": {}, "outputs": {}}


def transition(resource: str, before: str, after: str) -> dict[str, Any]:
    skillset, _, short = resource.partition(".")
    states = {"from_state": before, "to_state": after, "cause": "extern"}
    return {"skillset": skillset, "sequence": 1, "kind": "TRANSITION", "resource": short, **states}


Story = list[tuple[float, str, dict[str, Any]]]


def failing_story(name: str = "navigate") -> Story:
    """Return the entries of a flight whose ZED breaks 30 s after lift-off; the LiDAR takes over 0.5 s later."""
    why = "zed_ok: zed_status is BROKEN, after zed_status OK -> BROKEN (extern)"
    start = LIFT_OFF_S
    story: Story = [
        (start - 3, MISSION, {"scenario": "mapping", "outcome": "running", "reason": "", "waypoints": 5, "waypoints_reached": 0}),
        (start - 2, TREE, tree("INVALID", "INVALID", name=name)),
        (start, EVENTS, transition("navigation.flight_status", "ON_GROUND", "IN_AIR")),
        (start + 1, EVENTS, execution("perception.zed_depthmap", "REQUESTED", 1)),
        (start + 1, EVENTS, execution("perception.zed_depthmap", "RUNNING", 2)),
        (start + 1, TREE, tree("RUNNING", "INVALID", name=name)),
        (start + 30, EVENTS, transition("perception.zed_status", "OK", "BROKEN")),
        (start + 30, EVENTS, execution("perception.zed_depthmap", "RESOURCE_INVARIANT_VIOLATED", 3, result="zed_ok", message=why)),
        (start + 30, TREE, tree("FAILURE", "RUNNING", name=name)),
        (start + 30.5, EVENTS, execution("perception.lidar_depthmap", "REQUESTED", 4)),
        (start + 30.5, EVENTS, execution("perception.lidar_depthmap", "RUNNING", 5)),
    ]
    for step in range(300):
        place = {"x": step / 5, "y": 1.0, "z": 3.0}
        value = {"position_enu_m": place, "distance_to_go_m": 60 - step / 5, "mode": "GUIDED"}
        story.append((start + step / 5, DATA, {"skillset": "navigation", "data": "guidance_state", "value": value, "stamp_s": start}))
    end = {"scenario": "mapping", "outcome": "degraded", "reason": why, "waypoints": 5, "waypoints_reached": 5, "end_s": start + 61}
    return [*sorted(story, key=lambda entry: entry[0]), (start + 61, MISSION, end)]


def write_record(folder: Path, story: Story, *, over: bool = True) -> RecordWriter:
    """Write a story's record; ``over`` also ends the file."""
    folder.mkdir(parents=True, exist_ok=True)
    writer = RecordWriter(folder / FILE)
    for t_s, topic, value in story:
        writer.write(topic, round(t_s * 1e9), {**value, "stamp_s": t_s} if topic == EVENTS else value)
    if over:
        writer.close()
    return writer


def write_map(path: Path, count: int = 5000) -> None:
    points = np.random.default_rng(1).random((count, 3), dtype=np.float32) * np.float32([40, 20, 4])
    fields = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{fields}end_header\n"
    path.write_bytes(head.encode() + points.astype("<f4").tobytes())
