"""Files of JSON lines in a run's folder, read while they grow or afterwards."""

from __future__ import annotations

import json
from pathlib import Path

from alula.common.record import Entry


class LinesFollower:
    """Reads the lines of a file, or those of a ``kind``, as entries of a topic.

    ``stamp_s`` is mission clock, and lines without one are of before that was heard.
    """

    def __init__(self, path: Path, topic: str, kind: str | None = None) -> None:
        self._path = path
        self._topic = topic
        self._kind = kind
        self._offset = 0

    def poll(self) -> list[Entry]:
        """Return the entries since the last call; an incomplete line waits for the next call, one that makes no sense is left out."""
        if not self._path.is_file():
            return []
        with self._path.open("rb") as file:
            file.seek(self._offset)
            whole, end, _ = file.read().rpartition(b"\n")
        self._offset += len(whole) + len(end)
        return [entry for line in whole.splitlines() for entry in self._entries(line)]

    def _entries(self, line: bytes) -> list[Entry]:
        try:
            value = json.loads(line)
            if value.pop("kind", None) != self._kind:
                return []
            return [Entry(self._topic, round(float(value.get("stamp_s", 0.0)) * 1e9), value)]
        except (ValueError, AttributeError, TypeError, OverflowError):
            return []
