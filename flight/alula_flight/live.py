"""Show a flight while it happens: a line for every skill that starts or ends and for every resource that changes."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from alula_flight.deaths import read_deaths

_QUIET_STATES = {"REQUESTED"}


def event_line(event: Mapping[str, Any]) -> str | None:
    """Return what a person wants to read of one event, or None where it is not worth a line."""
    stamp = f"t={event.get('stamp_s', 0.0):6.1f} s"
    if "resource" in event and event.get("resource"):
        return f"{stamp}  {event['skillset']}.{event['resource']}: {event.get('from_state')} -> {event.get('to_state')}"
    state = event.get("state", "")
    if state in _QUIET_STATES or not event.get("skill"):
        return None
    named = f" {event['result']}" if event.get("result") else ""
    why = f" ({event['message']})" if event.get("message") and state != "RUNNING" else ""
    return f"{stamp}  {event['skillset']}.{event['skill']}: {state}{named}{why}"


class LiveEvents:
    """Follows ``events.jsonl`` and ``deaths.jsonl`` of a run's folder."""

    def __init__(self, out: Path, say: Callable[[str], None]) -> None:
        self._events = out / "events.jsonl"
        self._deaths = out / "deaths.jsonl"
        self._say = say
        self._offset = 0
        self._deaths_shown = 0

    def show_new(self) -> None:
        """Say what was written since the last call; half a line waits for its other half."""
        if self._events.exists():
            with self._events.open("rb") as file:
                file.seek(self._offset)
                for line in file:
                    if not line.endswith(b"\n"):
                        break
                    self._offset += len(line)
                    self._show(line)
        deaths = read_deaths(self._deaths)
        for death in deaths[self._deaths_shown :]:
            self._say(death.sentence())
        self._deaths_shown = len(deaths)

    def _show(self, line: bytes) -> None:
        try:
            text = event_line(json.loads(line))
        except (json.JSONDecodeError, TypeError, KeyError):
            return  # the report names unreadable lines
        if text is not None:
            self._say(text)
