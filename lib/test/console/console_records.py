"""The records of a run as the stack leaves them, for the console's tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from alula.common.record import DATA, EVENTS, FILE, MISSION, TREE, RecordWriter

LIFT_OFF_S = 12.0
VIOLATED = "RESOURCE_INVARIANT_VIOLATED"
HOSTILE = "<img src=x onerror=\"document.title='owned'\"></script><script>document.title='owned'</script>"


def node(name: str, kind: str, status: str, *children: dict[str, Any], message: str = "", skill: str = "") -> dict[str, Any]:
    return {"name": name, "kind": kind, "status": status, "message": message, "skill": skill, "children": list(children)}


def tree(watch: str, fallback: str, *, name: str = "navigate") -> dict[str, Any]:
    zed = node("watch with the ZED", "skill", watch, message="zed_ok" if watch == "FAILURE" else "", skill="perception.zed_depthmap")
    first = node("ZED navigation", "parallel", watch, zed)
    lidar = node("watch with the LiDAR", "skill", fallback, skill="perception.lidar_depthmap")
    second = node("LiDAR navigation", "sequence", fallback, lidar)
    return node(name, "selector", "RUNNING", first, second)


def execution(
    skill: str, state: str, number: int, *, result: str = "", message: str = "", states: dict[str, str] | None = None, **data: float
) -> dict[str, Any]:
    """Return an event's record; ``states`` and ``data``: of the condition that was unmet."""
    skillset, _, short = skill.partition(".")
    identity = {"skillset": skillset, "sequence": number, "kind": "EXECUTION", "skill": short, "id": short[:6]}
    found = {"name": result, "condition": "", "reason": message.partition(", after ")[0], "states": states or {}, "data": data}
    unmet = [found] if states or data else []
    return {**identity, "state": state, "result": result, "message": message, "unmet": unmet, "inputs": {}, "outputs": {}}


def transition(resource: str, before: str, after: str) -> dict[str, Any]:
    skillset, _, short = resource.partition(".")
    states = {"from_state": before, "to_state": after, "cause": "extern"}
    return {"skillset": skillset, "sequence": 1, "kind": "TRANSITION", "resource": short, **states}


Story = list[tuple[float, str, dict[str, Any]]]

RUNNING = {"scenario": "mapping", "outcome": "running", "reason": "", "waypoints": 5, "waypoints_reached": 0}


def failing_story(name: str = "navigate") -> Story:
    """Return the entries of a flight whose ZED breaks 30 s after lift-off; the LiDAR takes over 0.5 s later."""
    why = "zed_ok: zed_status is BROKEN, after zed_status OK -> BROKEN (extern)"
    start, broken = LIFT_OFF_S, {"zed_status": "BROKEN"}
    story: Story = [
        (start - 3, MISSION, {**RUNNING, "inputs": {"route": [[0, 0, 3], [60, 1, 3]]}}),
        (start - 2, TREE, tree("INVALID", "INVALID", name=name)),
        (start, EVENTS, transition("navigation.flight_status", "ON_GROUND", "IN_AIR")),
        (start + 1, EVENTS, execution("perception.zed_depthmap", "REQUESTED", 1)),
        (start + 1, EVENTS, execution("perception.zed_depthmap", "RUNNING", 2)),
        (start + 1, TREE, tree("RUNNING", "INVALID", name=name)),
        (start + 30, EVENTS, transition("perception.zed_status", "OK", "BROKEN")),
        (
            start + 30,
            EVENTS,
            execution("perception.zed_depthmap", "RESOURCE_INVARIANT_VIOLATED", 3, result="zed_ok", message=why, states=broken),
        ),
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


def lost_video() -> Story:
    """Return the entries of an inspection whose ground station is killed; the autopilot's failsafe overtakes the reaction."""
    start, why, taken = LIFT_OFF_S, "sdk_authority: SDK_authority is UNAVAILABLE", {"SDK_authority": "UNAVAILABLE"}
    inspect, lost = ({"kind": "sequence", "skill": "", "message": "", "children": []} for _ in range(2))

    def shape(first: str, second: str, third: str) -> dict[str, Any]:
        stream = {**inspect, "name": "send the video", "kind": "skill", "skill": "video.stream", "status": first}
        land = {**lost, "name": "land", "kind": "skill", "skill": "navigation.land", "status": second}
        branches = [
            {**inspect, "name": "inspect", "status": first, "children": [stream]},
            {**lost, "name": "the video was lost", "status": second, "children": [land]},
            {**lost, "name": "given up", "status": third},
        ]
        return {**inspect, "name": "inspection", "kind": "selector", "status": "RUNNING", "children": branches}

    def guided(t_s: float, mode: str) -> tuple[float, str, dict[str, Any]]:
        return (start + t_s, "/data", {"skillset": "navigation", "data": "guidance_state", "value": {"mode": mode}, "stamp_s": 0.0})

    picture = {"skillset": "video", "data": "picture", "value": {"fps_margin": -6}, "stamp_s": 1.0}
    low = execution(
        "video.stream",
        VIOLATED,
        2,
        result="enough_frames",
        message="picture.fps_margin is -6 for 1 s",
        **{"picture.fps_margin": -6},
    )
    return [
        (
            start - 3,
            MISSION,
            {
                "scenario": "inspection",
                "outcome": "running",
                "reason": "",
                "waypoints": 10,
                "waypoints_reached": 0,
                "inputs": {"route": [[6, 0, 3], [12, 0, 3]]},
            },
        ),
        (start, EVENTS, transition("navigation.flight_status", "ON_GROUND", "IN_AIR")),
        (start + 1, EVENTS, execution("video.stream", "RUNNING", 1)),
        (start + 2, EVENTS, execution("navigation.goto", "RUNNING", 1)),
        (start + 1, TREE, shape("RUNNING", "INVALID", "INVALID")),
        guided(2.0, "GUIDED"),
        (start + 40, "/fault", {"sensor": "ground_station", "mode": "killed"}),
        (start + 43, "/data", picture),
        (start + 43, EVENTS, low),
        (start + 43, TREE, shape("FAILURE", "RUNNING", "INVALID")),
        (start + 43.02, EVENTS, execution("navigation.goto", "INTERRUPTED", 2)),
        (start + 43.04, EVENTS, execution("navigation.hover", "RUNNING", 3)),
        (start + 43.06, EVENTS, execution("navigation.hover", "FAILED", 4, message="refused")),  # the reaction before is not its own
        guided(45.0, "RTL"),
        (start + 45, EVENTS, transition("navigation.SDK_authority", "AVAILABLE", "UNAVAILABLE")),
        (start + 45, EVENTS, execution("navigation.land", "NOT_READY", 3, result="sdk_authority", message=why, states=taken)),
        (start + 45, TREE, shape("FAILURE", "FAILURE", "RUNNING")),
        (start + 57, EVENTS, transition("navigation.flight_status", "IN_AIR", "ON_GROUND")),
        (start + 58, MISSION, {"outcome": "given_up", "reason": why, "waypoints": 10, "waypoints_reached": 2, "end_s": start + 58}),
    ]


def overtaken() -> tuple[Story, dict[str, Any]]:
    """Return the entries and the summary of a lost video whose loss was noticed early; the autopilot takes the vehicle from the hover."""
    start, taken = LIFT_OFF_S, {"SDK_authority": "UNAVAILABLE"}
    lost = "keep_sdk_authority: SDK_authority is UNAVAILABLE, after SDK_authority AVAILABLE -> UNAVAILABLE (extern)"
    guided = {"skillset": "navigation", "data": "guidance_state", "stamp_s": 0.0}
    kept = [entry for entry in lost_video() if entry[2].get("state") != "FAILED" and entry[2].get("data") != "guidance_state"]
    more: Story = [
        *[(start + t_s, "/data", {**guided, "value": {"mode": mode}}) for t_s, mode in ((2.0, "GUIDED"), (44.4, "GUIDED"), (45.4, "RTL"))],
        (start + 41, EVENTS, transition("video.link", "UP", "DOWN")),
        (
            start + 45,
            EVENTS,
            execution("navigation.hover", VIOLATED, 4, result="keep_sdk_authority", message=lost, states=taken),
        ),
    ]
    answer = {
        "sensor": "ground_station", "mode": "killed", "t_s": 40.0, "until_s": None,
        "detected_s": 41.0, "detected_by": "video.link UP -> DOWN",
        "failed": ["stream", "hover", "land"], "answered_by": "the video was lost", "skill": "navigation.hover", "after_s": 3.04,
    }  # fmt: skip
    recovery = {"failure_s": 40.0, "detected_s": 41.0, "fallback_running_s": 43.04, "moving_again_s": None}
    summary = {"outcome": "given_up", "reason": "", "landed": True, "collisions": 0, "recovery": recovery, "answers": [answer]}
    return sorted([*kept, *more], key=lambda entry: entry[0]), {**summary, "lift_off": {"stamp_s": start, "source": "simulator"}}


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
