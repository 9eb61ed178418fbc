"""The rover's part of a report: the floor and the way it went, for the page's map; how long that was; what became of the parcels."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from alula import ExecutionState, Record, parts

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

BAG, TRUTH, STATE = "functional.bag", "/truth/odom", "/truth/state"
PERIOD_S = 0.2
"""Between two places of the way on the page."""
DONE = {"drive_to": "ARRIVED", "open_door": "OPEN", "load": "LOADED", "unload": "UNLOADED"}
"""What a parcel needs of skills; what ends otherwise may be why it was not delivered."""
Place = tuple[float, float, float]
"""Seconds of mission clock, x and y in metres, frame map."""


class RoverReport(parts.NoPart):
    """Of a run over mocks there is nothing to show: there is no floor."""

    def __init__(self, run: parts.ReportedRun) -> None:
        self._run = run
        self._way: list[Place] = []

    def measure(self, phases: parts.Phases, *_: object) -> parts.Findings:
        """Read where the rover truly was; ``distance_m``: how far it went since it left its dock; ``collisions``: how often it hit something."""
        tasks: list[parts.Task] = []
        with self._run.problems.survive("the parcels"):
            tasks = list(parcels(Record(self._run.folder), self._run.history.executions))
        if self._run.facts.mock:
            return parts.Findings({"distance_m": None}, tasks=tasks)
        collisions: int | None = None
        bag = self._run.folder / BAG
        if bag.exists():
            with self._run.problems.survive(BAG):
                self._way, collisions = _truth(str(bag))
        elif self._run.facts.recorded:
            self._run.problems.note(f"{BAG} is missing: nothing is known of the rover's true path")
        since = phases.zero_s
        away = [place[1:] for place in self._way if place[0] >= since]
        driven_m = round(sum(map(math.dist, away, away[1:])), 2) if away else None
        return parts.Findings({"distance_m": driven_m, "collisions": collisions}, tasks=tasks)

    def entries(self) -> Iterator[parts.Entry]:
        """Return the outlines of what stands on the floor, and the way."""
        if self._run.facts.mock:
            return
        with self._run.problems.survive("the world"):
            yield "/world", None, _edges(self._run)
        last_s = -math.inf
        for t_s, x, y in self._way:
            if t_s - last_s >= PERIOD_S:
                last_s = t_s
                yield "/path", round(t_s, 3), [round(x, 3), round(y, 3), 0.0]


def parcels(record: Record, executions: Sequence[parts.ExecutionRecord]) -> Iterator[parts.Task]:
    """Return what became of each parcel that the mission was given, by what it counted; none for a mission that was given none."""
    given = [entry.value.get("inputs") for entry in record.topic("/mission")]
    names = [parcel["name"] for parcel in given[0].get("parcels", ())] if given and isinstance(given[0], dict) else []
    dealt: list[tuple[float, bool]] = []  # by parcel: until when it was the one that was dealt with, and whether it was delivered
    handled = delivered = 0
    for entry in record.topic("/blackboard"):
        before, delivered = delivered, int(entry.value.get("delivered", delivered))
        if (handled := int(entry.value.get("handled", handled))) > len(dealt):
            dealt.append((entry.stamp_s, delivered > before))
    since_s = -math.inf
    for name, (until_s, done) in zip(names, dealt, strict=False):
        yield parts.Task(name, done, "" if done else _why(executions, since_s, until_s))
        since_s = until_s
    for name in names[len(dealt) :]:
        moved = [one.result for one in executions if _parcel_of(one) == name and one.result in {"LOADED", "UNLOADED"}]
        yield parts.Task(
            name, done=False, why="the mission ended with it in the box" if moved[-1:] == ["LOADED"] else "the mission ended before"
        )


def _parcel_of(execution: parts.ExecutionRecord) -> object:
    return execution.inputs.get("parcel") if isinstance(execution.inputs, dict) else None


def _why(executions: Sequence[parts.ExecutionRecord], since_s: float, until_s: float) -> str:
    """Return what ended otherwise than it should, the last of these, while a parcel was dealt with."""
    ended = [one for one in executions if one.ended_s is not None and since_s < one.ended_s <= until_s and one.skill in DONE]
    failed = [one for one in ended if one.state is ExecutionState.TERMINATED and one.result != DONE[one.skill]]
    return f"{failed[-1].skill} {failed[-1].result}: {failed[-1].message}".removesuffix(": ") if failed else ""


def _truth(bag: str) -> tuple[list[Place], int | None]:
    import rosbag  # late: runs over mocks have no ROS 1

    way: list[Place] = []
    collisions: int | None = None
    with rosbag.Bag(bag) as file:
        for topic, message, _ in file.read_messages([TRUTH, STATE]):
            if topic == STATE:
                collisions = int(json.loads(message.data)["collisions"])
            else:
                at = message.pose.pose.position
                way.append((message.header.stamp.to_sec(), at.x, at.y))
    return way, collisions


def _edges(run: parts.ReportedRun) -> list[list[float]]:
    import shapely

    from rover_simulator.drawing import outlines
    from rover_simulator.world import load_world

    standing: Any = outlines(load_world(run.world))
    rings = [ring for part in shapely.get_parts(standing) for ring in (part.exterior, *part.interiors)]
    lines = [(one, other) for ring in rings for one, other in zip(list(ring.coords), list(ring.coords)[1:], strict=False)]
    return [[round(value, 2) for x, y in line for value in (x, y, 0.0)] for line in lines]
