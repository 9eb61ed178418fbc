"""What a mission leaves in the run's folder, whatever middleware it ran over."""

from __future__ import annotations

from pathlib import Path

from skill_missions.director import Director, End, Outcome
from skill_missions.drawing import draw
from skill_missions.files import EventLog, write_json, write_text
from skill_missions.plan import MissionPlan
from skill_runtime.core.events import EngineEvent, ExecutionEvent


class MissionRecord:
    """Writes ``mission.json`` at once, ``events.jsonl`` on the way, ``tree.json`` and ``tree.svg`` at the end."""

    def __init__(self, out: Path, plan: MissionPlan) -> None:
        self._out = out
        self._plan = plan
        self._departure_s: float | None = None
        self._unended: set[str] = set()
        self._events = EventLog(out / "events.jsonl")
        # So that a mission that is killed leaves one that says `running`.
        self._write_mission(End(Outcome.RUNNING), None, None)

    @property
    def unended(self) -> bool:
        """Tell whether executions are open as far as the events have told: a result may be here before its event."""
        return bool(self._unended)

    @property
    def departure_s(self) -> float | None:
        """When the plan's state of departure was left first, seconds of mission clock."""
        return self._departure_s

    def note(self, event: EngineEvent) -> None:
        """Write an event."""
        self._events.add(event)
        if isinstance(event, ExecutionEvent):
            (self._unended.discard if event.state.terminal else self._unended.add)(event.id)
        elif self._departure_s is None and self._plan.departure == (event.resource, event.from_state):
            self._departure_s = event.stamp_s

    def finish(self, end: End, director: Director, end_s: float) -> None:
        """Write what is left to write."""
        view = director.view()
        write_json(self._out / "tree.json", view.as_dict())
        write_text(self._out / "tree.svg", draw(view, f"Mission {self._plan.scenario}: {end.outcome.value.replace('_', ' ')}"))
        self._events.close()
        self._write_mission(end, director.start_s, end_s)

    def _write_mission(self, end: End, start_s: float | None, end_s: float | None) -> None:
        content = {
            "scenario": self._plan.scenario,
            "outcome": end.outcome.value,
            "reason": end.reason,
            "start_s": start_s,
            "lift_off_s": self._departure_s,
            "end_s": end_s,
            **self._plan.facts(),
        }
        write_json(self._out / "mission.json", content)
