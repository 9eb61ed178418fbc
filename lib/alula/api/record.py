"""The record of a run, as a program has it. A robot's part of a report reads it in the ROS 1 world, too, which has no trees."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from alula.common.public import public
from alula.common.record import DECISIONS, EVENTS, Entry, RecordError, read_record
from alula.runtime.core.events import EngineEvent, read_event
from alula.runtime.core.records import ExecutionRecord, executions_of


@public()
class Record:
    """The record of a run's decisions, ``skills.mcap``: its entries, in the order in which the mission received or made them.

    An entry has a ``topic``, a ``stamp_s`` (seconds of mission clock) and a ``value`` as JSON has it; the page on records lists the topics.
    Foxglove opens the file, too.

    Args:
        path: the file, or the folder of a run.

    Raises:
        RecordError: there is no such file, or it is no MCAP.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._entries = read_record(self.path)

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[Entry]:
        return iter(self._entries)

    def topic(self, name: str) -> list[Entry]:
        """Return the entries of a topic, as ``/decisions``."""
        return [entry for entry in self._entries if entry.topic == name]

    @property
    def topics(self) -> list[str]:
        """The topics that it has."""
        return sorted({entry.topic for entry in self._entries})

    @property
    def events(self) -> list[EngineEvent]:
        """The events of executions and resources."""
        return [_event(self.path, entry) for entry in self.topic(EVENTS)]

    @property
    def executions(self) -> list[ExecutionRecord]:
        """All executions of skills, the oldest first."""
        return executions_of(self.events)

    @property
    def decisions(self) -> list[Entry]:
        """The decisions of the mission: starts and interruptions of skills, pauses, resumptions."""
        return self.topic(DECISIONS)


def _event(path: Path, entry: Entry) -> EngineEvent:
    try:
        return read_event(dict(entry.value))
    except ValueError as error:
        raise RecordError(f"{path}: the message at {entry.stamp_s:.3f} s is no event: {error}") from None
