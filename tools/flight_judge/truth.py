"""What truly happened in a flight: the pose and the contacts as the simulator tells them, and what was really broken, from when to when.

The bag is read as it was recorded; nothing of the mission's record or of the report is used.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import ReaderError
from rosbags.typesys import Stores, get_typestore

POSES, STATES = {"/sim/true_pose", "/truth/odom"}, {"/sim/state", "/truth/state"}
"""The simulators' topics of the drone and the rover: geometry_msgs/PoseStamped or nav_msgs/Odometry, and JSON in std_msgs/String."""
DEPARTED = ("lift_off_s", "departed_s")
"""When the robot departed, absolute seconds of mission clock."""
REST_S = 1.0
"""Of the last so many seconds the motion is looked at, ..."""
REST_M = 0.05
"""... in which the vehicle moves no farther where it is at rest, ..."""
STANDS_M = 0.3
"""... standing: its centre is no higher than so much above where it started; all worlds that are flown have level ground."""
INJECTED, END, ACTS = "fault", "end", "act"
MENDED = "ok"


@dataclass(frozen=True)
class Broken:
    """Something that was really broken, or done: ``at_s`` to ``until_s``, seconds after lift-off."""

    what: str
    how: str
    at_s: float
    until_s: float = math.inf


@dataclass(frozen=True)
class Truth:
    """A flight as the simulator saw it; None where it tells nothing.

    ``ended_by``: who ended it before its mission did; empty: nobody. ``ended_why``: in words.
    """

    lift_off_s: float | None
    collisions: int | None
    crash: str
    min_clearance_m: float | None
    at_rest: bool | None
    broken: tuple[Broken, ...]
    ended_by: str = ""
    ended_why: str = ""


def truth_of(folder: Path) -> Truth:
    """Read a flight's folder: the bag, and the log of who broke processes and acted as the operator."""
    poses: list[tuple[float, float, float, float]] = []
    state: Mapping[str, Any] = {}
    try:
        with Reader(folder / "functional.bag") as bag:
            store = get_typestore(Stores.ROS1_NOETIC)
            for connection, _, raw in bag.messages(one for one in bag.connections if one.topic in POSES | STATES):
                message: Any = store.deserialize_ros1(raw, connection.msgtype)
                if connection.topic in STATES:
                    state = json.loads(message.data)
                else:
                    pose = message.pose if hasattr(message.pose, "position") else message.pose.pose
                    stamp, at = message.header.stamp, pose.position
                    poses.append((stamp.sec + stamp.nanosec * 1e-9, at.x, at.y, at.z))
    except (ReaderError, OSError, ValueError):
        pass
    lift_off_s = next((state[name] for name in DEPARTED if state.get(name) is not None), None)
    lines = list(_lines(folder / "run_log.jsonl"))
    told = [one for one in state.get("faults") or () if "t_s" in one]
    told += [one for one in lines if one.get("kind") == INJECTED]
    broken = [*_spans(told, lift_off_s), *_acts(lines, lift_off_s)]
    ended: Mapping[str, Any] = next((one for one in lines if one.get("kind") == END), {})
    return Truth(
        lift_off_s,
        state.get("collisions"),
        str(state.get("crash") or ""),
        state.get("min_clearance_m"),
        at_rest(poses),
        tuple(sorted(broken, key=lambda one: one.at_s)),
        str(ended.get("by", "")),
        str(ended.get("why", "")),
    )


def at_rest(poses: list[tuple[float, float, float, float]]) -> bool | None:
    """Return whether a vehicle with these poses (seconds, map ENU in metres) stands in the end; None: there are none."""
    if not poses:
        return None
    last = [pose for pose in poses if pose[0] >= poses[-1][0] - REST_S]
    moved_m = max(math.dist(pose[1:], last[-1][1:]) for pose in last)
    return moved_m <= REST_M and last[-1][3] <= poses[0][3] + STANDS_M


def _spans(changes: Iterable[Mapping[str, Any]], lift_off_s: float | None) -> list[Broken]:
    """Return what was broken until it changed again; before lift-off times are negative, without one they are absolute."""
    zero_s = lift_off_s or 0.0
    found: list[Broken] = []
    for one in sorted(changes, key=lambda change: float(change["t_s"])):
        at_s = float(one["t_s"]) - zero_s
        for index, known in enumerate(found):
            if known.what == one["sensor"] and math.isinf(known.until_s):
                found[index] = Broken(known.what, known.how, known.at_s, at_s)
        if one["mode"] != MENDED:
            found.append(Broken(str(one["sensor"]), str(one["mode"]), at_s))
    return found


def _acts(lines: Iterable[Mapping[str, Any]], lift_off_s: float | None) -> list[Broken]:
    acts = [one for one in lines if one.get("kind") == ACTS and "stamp_s" in one]
    return [Broken("operator", str(one.get("command")), float(one["stamp_s"]) - (lift_off_s or 0.0)) for one in acts]


def _lines(path: Path) -> Iterable[Mapping[str, Any]]:
    try:
        text = path.read_text(encoding="utf-8")
    except OSError:
        return
    for line in text.splitlines():
        try:
            one = json.loads(line)
        except ValueError:
            continue
        if isinstance(one, dict):
            yield one
