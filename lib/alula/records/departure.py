"""When the robot departed, as the record of its mission tells while it is written: times of faults count from then."""

from __future__ import annotations

from pathlib import Path

from alula.common.record import EVENTS, FILE, RecordFollower
from alula.records.run import departure


class Departure:
    """Follows ``skills.mcap``: the robot's state of departure is left first, or, where it has none, something happens first."""

    def __init__(self, out: Path) -> None:
        self._record = RecordFollower(out / FILE)
        self._place = departure()
        self._at_s: float | None = None

    def look(self) -> float | None:
        """Return when it departed, seconds of mission clock; None before."""
        for entry in self._record.poll() if self._at_s is None else ():
            place = entry.value.get("resource"), entry.value.get("from_state")
            if self._at_s is None and entry.topic == EVENTS and (self._place is None or place == self._place):
                self._at_s = float(entry.value["stamp_s"])
        return self._at_s
