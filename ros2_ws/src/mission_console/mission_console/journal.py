"""What the operator did: ``operator.jsonl`` in the run's folder, a line an act.

Not in ``skills.mcap``: the mission's process writes that, and two processes can't write one. Lines can be added after a restart.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from alula_common.record import OPERATOR, Entry

FILE = "operator.jsonl"


def note(folder: Path, stamp_s: float, act: Mapping[str, object]) -> None:
    """Write an act down: ``{command, by, answer}`` and what belongs to it; seconds of mission clock."""
    with (folder / FILE).open("a", encoding="utf-8") as file:
        file.write(json.dumps({"stamp_s": round(stamp_s, 3), **act}) + "\n")


class JournalFollower:
    """Reads the acts of a run, while they come or afterwards."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        self._offset = 0

    def poll(self) -> list[Entry]:
        """Return the acts that came since the last call; half a line waits for its other half, what is no act is left out."""
        if not self._path.is_file():
            return []
        with self._path.open("rb") as file:
            file.seek(self._offset)
            whole, end, _ = file.read().rpartition(b"\n")
        self._offset += len(whole) + len(end)
        return [entry for line in whole.splitlines() for entry in _acts(line)]


def _acts(line: bytes) -> list[Entry]:
    try:
        act = json.loads(line)
        return [Entry(OPERATOR, round(float(act["stamp_s"]) * 1e9), act)]
    except (ValueError, KeyError, TypeError):
        return []
