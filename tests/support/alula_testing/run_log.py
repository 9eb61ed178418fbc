"""Events of a run, as a record in its folder: made up, for tests of what reads them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from alula.common.record import EVENTS, REPORTS, RecordWriter

LIFT_OFF_S = 12.0  # of mission clock in all samples: nothing may depend on it


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
