"""What a mission leaves in the run's folder, whatever middleware it flew over."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from skill_missions.director import Director, End, Outcome
from skill_missions.drawing import draw
from skill_missions.files import EventLog, write_json, write_text
from skill_runtime.core import ExecutionState
from uav_missions.route import Route


class MissionRecord:
    """Writes ``route.json`` and ``mission.json`` at once, ``events.jsonl`` on the way, ``tree.json`` and ``tree.svg`` at the end."""

    def __init__(self, out: Path, scenario: str, route: Route) -> None:
        self._out = out
        self._scenario = scenario
        self._route = route
        self._lift_off_s: float | None = None
        self._unended: set[str] = set()
        self._events = EventLog(out / "events.jsonl")
        write_json(out / "route.json", {"frame": "map", "route": [list(waypoint) for waypoint in route.waypoints]})
        # So that a mission that is killed leaves one that says `running`.
        self._write_mission(End(Outcome.RUNNING), None, None)

    @property
    def unended(self) -> bool:
        """Tell whether executions are open as far as the events have told: a result may be here before its event."""
        return bool(self._unended)

    @property
    def lift_off_s(self) -> float | None:
        """When the vehicle first left the ground, seconds of mission clock."""
        return self._lift_off_s

    def note(self, record: Mapping[str, object]) -> None:
        """Write an event."""
        self._events.add(record)
        if record.get("skill"):
            ended = ExecutionState(record["state"]).terminal
            (self._unended.discard if ended else self._unended.add)(str(record["id"]))
        if record.get("resource") == "flight_status" and record["from_state"] == "ON_GROUND" and self._lift_off_s is None:
            self._lift_off_s = float(str(record["stamp_s"]))

    def finish(self, end: End, director: Director, end_s: float) -> None:
        """Write what is left to write."""
        view = director.view()
        write_json(self._out / "tree.json", view.as_dict())
        write_text(self._out / "tree.svg", draw(view, f"Mission {self._scenario}: {end.outcome.value.replace('_', ' ')}"))
        self._events.close()
        self._write_mission(end, director.start_s, end_s)

    def _write_mission(self, end: End, start_s: float | None, end_s: float | None) -> None:
        content = {
            "scenario": self._scenario,
            "outcome": end.outcome.value,
            "reason": end.reason,
            "start_s": start_s,
            "lift_off_s": self._lift_off_s,
            "end_s": end_s,
            "waypoints": len(self._route.waypoints),
            "waypoints_reached": self._route.reached,
        }
        write_json(self._out / "mission.json", content)
