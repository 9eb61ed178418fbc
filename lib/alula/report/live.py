"""Show a run while it happens: a line for every skill that starts or ends and for every resource that changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from alula.common.record import EVENTS, FILE, RecordFollower
from alula.common.run_log import read_held, read_waits
from alula.model.execution_state import ExecutionState
from alula.records.conformance import Monitor
from alula.records.run import departure
from alula.report.deaths import read_deaths
from alula.runtime.core.events import EngineEvent, TransitionEvent, read_event


def event_line(event: EngineEvent, lift_off_s: float | None = None, begun_s: float = 0.0) -> str | None:
    """Return the line that shows an event; None for events that are not shown.

    Times count from lift-off; before it, and marked so, from ``begun_s``: no matter where the mission clock begins to count.
    """
    stamp = f"start+{event.stamp_s - begun_s:4.1f} s" if lift_off_s is None else f"t={event.stamp_s - lift_off_s:6.1f} s"
    if isinstance(event, TransitionEvent):
        return f"{stamp}  {event.skillset}.{event.resource}: {event.from_state} -> {event.to_state}"
    if event.state is ExecutionState.REQUESTED:
        return None
    named = f" {event.result}" if event.result else ""
    why = f" ({event.message})" if event.message and event.state is not ExecutionState.RUNNING else ""
    return f"{stamp}  {event.skillset}.{event.skill}: {event.state.value}{named}{why}"


class LiveEvents:
    """Follows ``skills.mcap`` and ``run_log.jsonl`` of a run's folder.

    A ``monitor`` is given each event, and what it finds is said.
    """

    def __init__(self, out: Path, say: Callable[[str], None], monitor: Monitor | None = None) -> None:
        self._record = RecordFollower(out / FILE)
        self._out = out
        self._say = say
        self._monitor = monitor
        self._begun_s: float | None = None
        self._lift_off_s: float | None = None
        self._departure = departure()
        self._deaths_shown = self._waits_shown = self._held_shown = 0

    def show_new(self) -> None:
        """Print what was written since the last call; an incomplete entry waits for the next call."""
        for entry in self._record.poll():
            if entry.topic == EVENTS:
                self._show(entry.value)
        waits = list(read_waits(self._out))
        for wait in waits[self._waits_shown :]:
            self._say(f"waiting for {wait}")
        self._waits_shown = len(waits)
        held = read_held(self._out)
        for how in held[self._held_shown :]:
            self._say(f"waiting: {how}")
        self._held_shown = len(held)
        deaths = read_deaths(self._out)
        for death in deaths[self._deaths_shown :]:
            self._say(death.sentence())
        self._deaths_shown = len(deaths)

    def _show(self, record: Mapping[str, object]) -> None:
        try:
            event = read_event(record)
        except ValueError:
            return  # the report names it
        if self._begun_s is None:
            self._begun_s = event.stamp_s
        if self._lift_off_s is None and isinstance(event, TransitionEvent) and (event.resource, event.from_state) == self._departure:
            self._lift_off_s = event.stamp_s
        text = event_line(event, self._lift_off_s, self._begun_s)
        if text is not None:
            self._say(text)
        finding = None if self._monitor is None else self._monitor.take(event)
        if finding is not None:
            self._say(f"does not conform to the model: {finding}")
